"""Model of a strapdown unit: from samples to rate and specific force."""
