"""The commands in a browser, and an instrument by wire."""
