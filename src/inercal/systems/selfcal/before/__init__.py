"""Before a test: bounds, observability, paths, simulation."""
