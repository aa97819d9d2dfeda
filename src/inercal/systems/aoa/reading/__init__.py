"""From a record to what the fusion takes: calibrated, on one clock, with its pauses and its wind-off zero."""
