"""Nodes of a live experiment (with ROS): experiment and spawner, and their common parts."""
