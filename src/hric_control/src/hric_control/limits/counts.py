"""Counts of the commands that joint limits changed, by which users notice that limits act."""

from collections.abc import Sequence
from typing import Any

from hric_core.node import Node
from hric_core.realtime import RealtimePublisher, publisher
from hric_msgs.msg import JointLimitCounts


class LimitCounts:
    """Counts of the commands that joint limits changed, and largest measured values. Lists are in the order of `names`.

    Attributes:
        names: joint names.
        cycles: number of cycles in which limits were enforced.
        position, velocity, effort, effort_rate: number of cycles in which this limit changed the command by more than
            1e-12, per joint. Changes by an acceleration limit count as velocity. A command that is not finite counts as
            effort, velocity or position, the kind of its interface.
        speed_limit: velocity limit per joint [rad/s].
        speed_max: largest measured speed per joint [rad/s].
        position_excess_max: largest measured distance beyond the position range, per joint [rad].
        started_outside: True if the joint was outside its position range at the start of the run.
        not_finite: number of commands that were not finite and were replaced by the previous one, per joint.
        run: number of calls of `clear`, by which limiters notice such a call.
    """

    __slots__ = (
        "cycles",
        "effort",
        "effort_rate",
        "names",
        "not_finite",
        "position",
        "position_excess_max",
        "run",
        "speed_limit",
        "speed_max",
        "start_checked",
        "started_outside",
        "velocity",
    )

    def __init__(self, names: Sequence[str], speed_limit: Sequence[float]) -> None:
        self.names = tuple(names)
        self.speed_limit = list(speed_limit)
        n = len(self.names)
        self.position, self.velocity, self.effort, self.effort_rate, self.not_finite = (
            [0] * n,
            [0] * n,
            [0] * n,
            [0] * n,
            [0] * n,
        )
        self.speed_max, self.position_excess_max = [0.0] * n, [0.0] * n
        self.started_outside = [False] * n
        self.cycles = self.run = 0
        self.start_checked = False

    @property
    def velocity_ratio_max(self) -> list[float]:
        """Largest measured speed divided by the velocity limit [1]; 0 for a limit of 0."""
        return [
            top / limit if limit > 0.0 else 0.0 for top, limit in zip(self.speed_max, self.speed_limit, strict=True)
        ]

    @property
    def total(self) -> int:
        """Number of limited commands, summed over joints and kinds of limit; 0: no limit changed a command."""
        return sum(self.position) + sum(self.velocity) + sum(self.effort) + sum(self.effort_rate)

    def clear(self) -> None:
        """Reset all counts to zero at the start of a run. The lists stay the same objects."""
        for values in (self.position, self.velocity, self.effort, self.effort_rate, self.not_finite):
            values[:] = [0] * len(self.names)
        self.speed_max[:] = [0.0] * len(self.names)
        self.position_excess_max[:] = [0.0] * len(self.names)
        self.started_outside[:] = [False] * len(self.names)
        self.cycles = 0
        self.run += 1
        self.start_checked = False

    def copy(self) -> "LimitCounts":
        """Return a copy of the present counts."""
        snapshot = LimitCounts(self.names, self.speed_limit)
        for name in self.__slots__:
            value = getattr(self, name)
            setattr(snapshot, name, value[:] if isinstance(value, list) else value)
        return snapshot

    @classmethod
    def joined(cls, parts: "Sequence[LimitCounts]") -> "LimitCounts":
        """Return the present counts of several robots as those of one robot with all their joints."""
        result = cls([name for part in parts for name in part.names], [])
        for key in cls.__slots__:
            values = [getattr(part, key) for part in parts]
            if isinstance(values[0], list):
                setattr(result, key, [value for part in values for value in part])
        result.cycles, result.run = max(part.cycles for part in parts), max(part.run for part in parts)
        result.start_checked = all(part.start_checked for part in parts)
        return result

    @staticmethod
    def publisher(node: Node) -> RealtimePublisher:
        """Return a publisher of `message` on the topic `limit_counts` of a node."""
        return publisher(node, "limit_counts", JointLimitCounts)

    def message(self, stamp: Any) -> Any:
        """Return the counts as hric_msgs/JointLimitCounts.

        Args:
            stamp: stamp of the header (genpy.Time).
        """
        message = JointLimitCounts(
            joint_names=list(self.names),
            cycles=self.cycles,
            position=list(self.position),
            velocity=list(self.velocity),
            effort=list(self.effort),
            effort_rate=list(self.effort_rate),
            velocity_ratio_max=self.velocity_ratio_max,
            position_excess_max=list(self.position_excess_max),
            started_outside=list(self.started_outside),
        )
        message.header.stamp = stamp
        return message
