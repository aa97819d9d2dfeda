"""Multi-position calibration of an IMU held in the hand: no table, and every number with its uncertainty."""
