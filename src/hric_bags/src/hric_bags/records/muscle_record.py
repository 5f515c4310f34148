"""Muscle data of a simulated human in a run, from topics in its bag. No ROS.

All muscle data are estimates by a model.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.reader import FloatArray, seconds

TOPICS = ("activation", "muscle_force", "joint_reactions")
"""Names of the topics with muscle data in the human's namespace."""


@dataclass(frozen=True)
class MuscleRecord:
    """Muscle data of one human in one run.

    Attributes:
        names: names of k muscles and of the ideal actuators of joints without muscles.
        is_muscle: True for a muscle, shape (k,).
        time: robot time, shape (n,) [s].
        activation: activations, shape (n, k) [1].
        limited: number of times a muscle would have needed more activation than it can have, by name.
        force: largest force of each muscle, by name [N].
        outside: share of the time in which the posture was outside the range for which muscle paths are fitted [1].
        contact_time: robot time of the rows of `contact`, shape (m,) [s].
        contact: magnitude of the contact force between the bones of a joint, by joint, shape (m,) [N].
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
        """Names of the muscles, without ideal actuators."""
        return tuple(name for name, is_muscle in zip(self.names, self.is_muscle, strict=True) if is_muscle)


class MuscleMessages:
    """Collector of messages with muscle data of simulated humans.

    Args:
        humans: namespaces of the humans.
    """

    def __init__(self, humans: Iterable[str]) -> None:
        self._topics = {f"{human}/{topic}": topic for human in humans for topic in TOPICS}
        self._rows: dict[str, list[tuple[float, Any]]] = {topic: [] for topic in TOPICS}

    def wants(self, connection: Any) -> bool:
        """Return True if a connection has muscle data of these humans."""
        return connection.topic in self._topics

    def add(self, topic: str, message: Any) -> None:
        """Add a message of a topic with muscle data."""
        self._rows[self._topics[topic]].append((seconds(message.header.stamp), message))

    def record(self, robot_time: Callable[[float], float]) -> MuscleRecord | None:
        """Return the record of all messages; None: the bodies have no muscles."""
        activations, forces, reactions = (self._rows[topic] for topic in TOPICS)
        if not activations or not forces:
            return None
        names, muscles = tuple(activations[0][1].name), list(forces[0][1].name)
        largest = np.max([message.force for _, message in forces], axis=0)
        contact = {}
        for index, joint in enumerate(reactions[0][1].joint_names if reactions else ()):
            joint_forces = [message.wrenches[index].force for _, message in reactions]
            contact[joint] = np.linalg.norm([(f.x, f.y, f.z) for f in joint_forces], axis=1)
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
