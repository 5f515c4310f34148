"""Distance between a person and an arm, and the required distance."""
