"""Commands for experiments, nodes of live experiments, recorder, and check of the robot model."""

from hric_core import former_names

former_names.install()
