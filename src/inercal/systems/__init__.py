"""The systems: a room for each, what each of them offers, and the list of them."""
