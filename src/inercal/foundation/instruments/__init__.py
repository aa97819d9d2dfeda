"""Instruments: their terms, and the models that take truth to indication."""
