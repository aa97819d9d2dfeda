"""Bias and scale factor against temperature."""
