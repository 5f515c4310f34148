"""Mesh files of descriptions, read only by this project, never by an engine."""
