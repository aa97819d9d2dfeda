"""Reports: results and recordings as self-contained HTML pages with figures in one common style."""
