"""Comparison of contacts between person and robot with the force and pressure limits of body regions."""
