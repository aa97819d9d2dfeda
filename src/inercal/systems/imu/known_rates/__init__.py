"""A gyro on a platter or rate table of known rates, in unknown orientations."""
