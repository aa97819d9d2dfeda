"""Sensor noise: Allan variance and what follows from it."""
