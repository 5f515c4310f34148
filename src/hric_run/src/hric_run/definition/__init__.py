"""Experiment files: reading, checking, overrides on the command line, and conversion to ROS parameters."""
