"""Calibration from positions of a table: its design, simulation, fit and result."""
