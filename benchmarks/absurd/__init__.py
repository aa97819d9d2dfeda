"""Absurd studies and recordings, run as a command runs them, and the laws that every run obeys."""
