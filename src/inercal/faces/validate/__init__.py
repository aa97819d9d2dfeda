"""Published and closed-form cases that ship with the package, for the validation of software in a laboratory."""
