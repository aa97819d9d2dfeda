"""Noise that a recording shows, and effects outside the model."""
