"""What the muscles of a simulated human did in a run, from the topics in its bag. No ROS.

All of it is an estimate of a model.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.reader import FloatArray, seconds

TOPICS = ("activation", "muscle_force", "joint_reactions")
"""Below the human's name."""


@dataclass(frozen=True)
class MuscleRecord:
    """Of one run.

    Attributes:
        names: of k muscles, and of ideal actuators of joints without any.
        is_muscle: of each, whether it is one.
        time: robot time, shape (n,) [s].
        activation: shape (n, k) [1].
        limited: by name, how often all was required of it.
        force: largest of each muscle, by name [N].
        outside: share of the time in which the posture was outside the range of muscle paths [1].
        contact_time: of the rows of `contact`, shape (m,) [s].
        contact: size of the contact force, by joint centre, shape (m,) [N].
    """

    names: tuple[str, ...]
    is_muscle: npt.NDArray[np.bool_]
    time: FloatArray
    activation: FloatArray
    limited: dict[str, int]
    force: dict[str, float]
    outside: float
    contact_time: FloatArray
    contact: dict[str, FloatArray]

    @property
    def muscles(self) -> tuple[str, ...]:
        """Names of muscles alone."""
        return tuple(name for name, own in zip(self.names, self.is_muscle, strict=True) if own)


class MuscleMessages:
    """Takes messages as they come.

    Args:
        humans: what their topics begin with.
    """

    def __init__(self, humans: Iterable[str]) -> None:
        self._topics = {f"{human}/{topic}": topic for human in humans for topic in TOPICS}
        self._rows: dict[str, list[tuple[float, Any]]] = {topic: [] for topic in TOPICS}

    def wants(self, connection: Any) -> bool:
        """Whether a connection is one of his muscles."""
        return connection.topic in self._topics

    def add(self, topic: str, message: Any) -> None:
        """Take one."""
        self._rows[self._topics[topic]].append((seconds(message.header.stamp), message))

    def record(self, robot_time: Callable[[float], float]) -> MuscleRecord | None:
        """All that was taken; None: his joints have no muscles."""
        activations, forces, reactions = (self._rows[topic] for topic in TOPICS)
        if not activations or not forces:
            return None
        names, muscles = tuple(activations[0][1].name), list(forces[0][1].name)
        largest = np.max([message.force for _, message in forces], axis=0)
        contact = {}
        for index, joint in enumerate(reactions[0][1].joint_names if reactions else ()):
            found = [message.wrenches[index].force for _, message in reactions]
            contact[joint] = np.linalg.norm([(f.x, f.y, f.z) for f in found], axis=1)
        return MuscleRecord(
            names,
            np.isin(names, muscles),
            np.array([robot_time(stamp) for stamp, _ in activations]),
            np.array([message.activation for _, message in activations]),
            dict(zip(names, map(int, activations[-1][1].limited), strict=True)),
            dict(zip(muscles, map(float, largest), strict=True)),
            float(np.mean([message.outside for _, message in forces])),
            np.array([robot_time(stamp) for stamp, _ in reactions]),
            contact,
        )
