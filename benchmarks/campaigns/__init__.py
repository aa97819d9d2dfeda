"""Simulated calibrations, one a call, that the campaigns repeat: are the stated uncertainties true?"""
