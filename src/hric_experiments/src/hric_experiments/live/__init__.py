"""Nodes of a live experiment."""
