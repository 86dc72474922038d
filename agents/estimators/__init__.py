"""Estimators of relative positions, one family a file; `base.py` says what an estimator is."""
