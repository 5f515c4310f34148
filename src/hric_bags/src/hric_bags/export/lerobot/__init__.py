"""Data sets of LeRobot, version 3.0, in which each run is an episode."""
