"""Where an instrument is mounted: kinematic chains with their errors, tables, plans, references."""
