"""A gyro alone, turned by known angles about each axis."""
