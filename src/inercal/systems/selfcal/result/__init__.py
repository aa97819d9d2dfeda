"""From the filter to the estimate: budget, verdict, tables."""
