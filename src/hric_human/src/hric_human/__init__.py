"""Simulated human next to the robot; see `hric_human.body`."""
