"""The vocabulary and life cycle of ros_control, in Python: interfaces, limits, transmissions, controllers, manager,
loop."""
