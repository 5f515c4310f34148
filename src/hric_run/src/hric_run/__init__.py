"""Experiment files, and their simulation in one process."""
