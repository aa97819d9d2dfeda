"""The laboratory: results kept for years, their history, certificates.

A store is a database and a folder of objects. Results, coefficients, certificates and events are only ever added;
a correction is a new row that says what it supersedes, and why.
"""
