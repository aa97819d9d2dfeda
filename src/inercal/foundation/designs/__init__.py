"""Which positions tell most: criteria and exchange."""
