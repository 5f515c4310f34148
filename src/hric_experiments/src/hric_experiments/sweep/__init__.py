"""Sweeps: one experiment in many runs, and what they say together."""
