"""The commands in a browser, and instruments by wire."""
