"""The paper's methods, which work without a filter."""
