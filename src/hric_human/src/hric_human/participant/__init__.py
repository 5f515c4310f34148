"""Simulated human in the robot's plant: body, control, grips and topics."""
