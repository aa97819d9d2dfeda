"""Estimates: what was found, how sure one can be of it, and whether that claim holds."""
