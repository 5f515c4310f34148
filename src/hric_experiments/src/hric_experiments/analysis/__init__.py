"""From a recorded run to its metrics."""
