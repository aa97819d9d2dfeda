"""Faults of a recording or its study, named."""
