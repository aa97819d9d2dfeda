"""Accelerometers from the mean outputs of poses: one row for each pose, no recording."""
