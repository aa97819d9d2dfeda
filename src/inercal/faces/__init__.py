"""What people and programs meet: study files, pages, streams, verbs of Python, conversion, validation."""
