"""Test by small steps about level: threshold, dead zone and hysteresis of accelerometers."""
