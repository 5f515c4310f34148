"""Alias for one release: trials are read by `hric_core.trial.c3d` now."""

from hric_core.trial.c3d import Trial, read_trial

__all__ = ["Trial", "read_trial"]
