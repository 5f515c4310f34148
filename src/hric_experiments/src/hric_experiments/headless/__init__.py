"""Experiments without a master, as fast as the machine allows."""
