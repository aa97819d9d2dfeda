"""Inference: least squares, filters' parts, variances, identifiability, coverage, hypotheses."""
