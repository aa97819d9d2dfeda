"""Runs of a tunnel entry: wind-off records, polars up and down, oscillations, and what they say together."""
