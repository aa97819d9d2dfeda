"""A toy: one number from the mean of a channel."""
