"""Marker tracking: samples, filters and targets of the end effector."""
