"""Interfaces, limits, transmissions, controllers, manager and control loop of ros_control, in Python."""

from hric_core import former_names

former_names.install()
