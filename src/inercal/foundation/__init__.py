"""The shared floors: data, geometry, instruments, rigs, results, inference."""
