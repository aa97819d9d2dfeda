"""Sections found in recordings, and what names and tables say of them."""
