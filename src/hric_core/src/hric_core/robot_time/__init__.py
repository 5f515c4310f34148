"""Time of a run: stamps, and its mapping from the monotonic clock of each process."""
