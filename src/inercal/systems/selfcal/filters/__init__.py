"""The estimators of the coefficients."""
