"""Sensors that measure the human next to the robot."""
