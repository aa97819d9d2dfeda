"""Calibration of an IMU after Ferraris, six sides and three turns: a shorthand of one from sections."""
