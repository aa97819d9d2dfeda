"""Rotations in plain NumPy and their compiled twins; gravity and Earth rate at a site."""
