"""Metrics of recorded runs."""
