"""Recorded motion laboratory trials, which emulated sensors replay: markers, analog channels, force plates."""
