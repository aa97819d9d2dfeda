"""One calibration of an IMU from sections, each of which says what is known of it."""
