"""Continuous self-calibration of a gimbaled platform: rig, simulation, filters, bounds, path design."""
