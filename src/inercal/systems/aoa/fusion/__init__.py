"""The filter of all sensors, and its smoother."""
