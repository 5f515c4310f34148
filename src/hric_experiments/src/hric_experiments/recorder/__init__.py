"""Recorder of a live run into a run folder."""
