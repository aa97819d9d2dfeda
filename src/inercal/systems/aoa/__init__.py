"""Inertial angle of attack: three accelerometers and a gyro in a wind-tunnel model."""
