"""A campaign of faults that the rules of judgement were not written for: its simulators share no code with inercal."""
