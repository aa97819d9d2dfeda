"""System-level calibration of a strapdown unit from rests and coarse turns, without a precise table."""
