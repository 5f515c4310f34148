"""Samples of many sources, at their own rates, brought to common instants."""
