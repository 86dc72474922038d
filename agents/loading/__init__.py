"""What estimators and laws return, checked."""
