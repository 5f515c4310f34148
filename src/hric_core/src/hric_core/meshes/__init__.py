"""Mesh files of descriptions: read by this project's readers alone, never by an engine's."""
