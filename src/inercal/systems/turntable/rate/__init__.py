"""Rate test of gyros: the table turns at constant rates."""
