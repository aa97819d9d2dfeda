"""Rigs that carry an instrument: kinematic chains with their errors, tables, plans, references."""
