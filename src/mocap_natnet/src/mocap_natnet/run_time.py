"""Alias for one release: `RunTime` is `hric_core.robot_time.follower.RobotTime` now."""

from hric_core.robot_time.follower import RobotTime as RunTime

__all__ = ["RunTime"]
