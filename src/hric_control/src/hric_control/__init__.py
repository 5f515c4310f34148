"""Implementation of ros_control in Python: interfaces, limits, transmissions, controllers, manager, control loop."""

from hric_core import former_names

former_names.install()
