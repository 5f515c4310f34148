"""Emulated controller of a UR e-Series arm: RTDE, script port and dashboard server for an unmodified ur_rtde."""
