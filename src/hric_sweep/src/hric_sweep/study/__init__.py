"""Studies: forms of one experiment, run and compared with each other."""
