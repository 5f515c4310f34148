"""Experiment and study files: reading, checking, overriding, and what they mean as parameters."""
