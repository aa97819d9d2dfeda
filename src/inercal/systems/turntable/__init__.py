"""Turntable calibration: sensitivity of the rig, test design, drift coefficients with uncertainties."""
