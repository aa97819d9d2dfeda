"""Calibration of an IMU on a table whose angles are known: full matrices, biases that wander, all with covariance."""
