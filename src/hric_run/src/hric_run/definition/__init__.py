"""Experiment and study files: reading, checking, overrides, and their conversion to parameters."""
