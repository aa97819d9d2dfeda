"""Before a test: bounds, plans, foresight."""
