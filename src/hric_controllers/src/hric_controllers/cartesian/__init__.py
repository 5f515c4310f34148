"""Cartesian impedance control and motion to poses."""
