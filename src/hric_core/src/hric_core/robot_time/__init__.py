"""Robot time (simulation time, or the real robot's clock): message stamps, and mapping from the monotonic clock."""
