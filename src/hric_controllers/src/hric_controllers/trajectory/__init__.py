"""Joint trajectory controllers: goals, messages, splines, tolerances."""
