"""Comparison of contacts between person and robot with the limits of the body."""
