"""The platform: gimbals, path, coefficients, equations of motion and measurement."""
