"""Every fault of every system for `faults.py`: a module each, on the simulators of `independent/`."""
