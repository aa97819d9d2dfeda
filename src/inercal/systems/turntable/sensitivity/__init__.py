"""Sensitivity of a table: the share of each error of the table in what the instrument should read."""
