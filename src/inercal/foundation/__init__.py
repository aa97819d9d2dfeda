"""Shared floors: data, geometry, instruments, rigs, statistics of results."""
