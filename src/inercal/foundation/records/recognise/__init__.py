"""Recordings recognised by evidence: the words of a header, the numbers below it, and the physics between them."""
