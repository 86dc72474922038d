"""A user's own code: found, its parameters checked, called, and what it returns refused where it is something else."""
