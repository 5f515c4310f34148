"""Measurements at the simulated robot and person, as a test house makes them."""
