"""Mesh files of robot descriptions: reading and conversion, so that every physics engine gets the same surface."""
