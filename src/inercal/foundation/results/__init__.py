"""The one result: estimate, basis, budget, files, comparison of results."""
