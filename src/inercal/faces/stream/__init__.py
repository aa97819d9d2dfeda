"""Lines in, lines out: recursive estimators run on a stream, their state saved and resumed."""
