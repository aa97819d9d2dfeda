"""From the filter to the estimate: budget, verdict, points, tables."""
