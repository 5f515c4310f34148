"""Angles and moments of a recorded person from a trial of a laboratory: command, files and page."""
