"""Sensors calibrated against a reference angle."""
