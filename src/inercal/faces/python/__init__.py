"""The face for Python: the verbs of `inercal`, and what they give back."""
