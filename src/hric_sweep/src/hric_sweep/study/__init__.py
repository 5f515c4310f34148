"""Studies: variants of one experiment, run and compared with each other."""
