"""Coefficients from rests and turns: the batch, the filter, and how they begin."""
