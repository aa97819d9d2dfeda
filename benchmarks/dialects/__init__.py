"""Dialects of recordings: motions, ways to write tables, and how the logs of many makers look."""
