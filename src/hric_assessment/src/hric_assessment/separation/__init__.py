"""Distance between a person and an arm, and the protective separation distance that ISO/TS 15066 requires."""
