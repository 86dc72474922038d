"""What an estimator or a law is worth over a network: tasks by airs, the same draws for all, and how sure one may be."""
