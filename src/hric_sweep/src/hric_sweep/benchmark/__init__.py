"""Controllers compared over collaborations, bodies and seeds, by stated rules."""
