"""Simulated robots: their loop, services and topics, and the robot of any description with transmissions."""
