"""The estimate of a strapdown unit put together."""
