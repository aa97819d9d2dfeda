"""Calibrations put to use."""
