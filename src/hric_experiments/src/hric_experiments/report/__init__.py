"""Metrics as text and figures."""
