"""Ferraris calibration of an IMU: six positions on a level surface and three turns by a known angle."""
