"""Simulated human next to the robot; see `hric_human.body`."""

from hric_core import former_names

former_names.install()
