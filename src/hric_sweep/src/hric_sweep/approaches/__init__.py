"""Random approaches of a person to a working arm, to test whether the supervisor keeps contacts within the limits."""
