"""The systems: what each of them offers, and the list of them."""
