"""Many units of one make, calibrated by one study: a row each, and what the fleet says as a whole."""
