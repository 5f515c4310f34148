"""Recorded trials of a laboratory, which emulated sensors replay: markers, analog channels, force plates."""
