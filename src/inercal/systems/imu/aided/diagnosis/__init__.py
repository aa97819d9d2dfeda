"""Diagnosis of a test on a table: its faults by name."""
