"""What is wrong with a test on a table, named."""
