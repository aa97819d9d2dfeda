"""Calibration of an IMU by hand, by six positions, on a table, and over temperature; each method has a room."""
