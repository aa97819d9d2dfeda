"""Files that are spoiled on purpose: whole ones of every format that is read, what is done to them, strict parsers."""
