"""What is wrong with a recording or its study, named."""
