"""Study files, pages, streams, conversion, validation and the verbs of Python: all that people and programs meet."""
