"""Recordings: labelled columns with units, what is suspicious about them, and how they are read."""
