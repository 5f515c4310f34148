"""Nodes of motion capture."""
