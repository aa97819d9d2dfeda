"""What an instrument is: its terms, and the models that take truth to indication."""
