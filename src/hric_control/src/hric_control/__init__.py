"""Interfaces, limits, transmissions, controllers, manager and control loop of ros_control, in Python."""
