"""Simulated robots: control loop, services and topics, and a robot for any description with transmissions."""
