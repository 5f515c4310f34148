"""What presses on an emulated force plate. No ROS."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_control.geometry import Pose, Vector
from hric_control.geometry.quaternions import rotated
from hric_control.parameters import Settings, number, numbers, text, variant
from hric_perception.chunk import FloatArray
from hric_perception.plate.geometry import CHANNELS, wrench_at
from hric_perception.replayed import RecordedLoad, Track

CONTACTS_PERIOD = 0.01
"""Period of `sim/contacts` [s]; it is silent while nothing touches."""
CONTACTS_DELAY = 0.03
"""So long after a sample was taken its contacts are known [s] (project default, unconfirmed: two periods, and the
way)."""

Load = Callable[[FloatArray], FloatArray]
"""Run times, shape (n,) [s] -> wrench on the plate in its frame, shape (n, 6) [N, N m]."""


@dataclass(frozen=True)
class Push(Settings):
    """A push that swells and fades, again and again."""

    force: float = number(100.0, minimum=0.0, maximum=1e5, unit="N")
    point: tuple[float, float] = numbers(2, (0.1, 0.05), unit="m")
    period: float = number(2.0, minimum=0.01, maximum=3600.0, unit="s")

    def load(self) -> Load:
        """As a function."""
        wrench = wrench_at((*self.point, 0.0), (0.0, 0.0, -self.force))
        return lambda times: 0.5 * (1 - np.cos(2 * np.pi * times / self.period))[:, None] * wrench


@dataclass(frozen=True)
class Constant(Settings):
    """Always the same."""

    wrench: tuple[float, ...] = numbers(len(CHANNELS), (0.0,) * len(CHANNELS), unit="N, N m")

    def load(self) -> Load:
        """As a function."""
        wrench = np.array(self.wrench)
        return lambda times: np.tile(wrench, (len(times), 1))


@dataclass(frozen=True)
class Contacts(Settings):
    """What presses in the simulation."""

    body: str = text("plate")
    topic: str = text("sim/contacts", valid="a topic of gazebo_msgs/ContactsState", empty=False)


PROGRAM: Any = variant(
    "program",
    {"push": Push, "constant": Constant, "contacts": Contacts, "c3d": RecordedLoad},
    "push",
    {},
    default_text="`{program: push}`",
    text="`push` (`force` [N], `point` [x, y] [m], `period` [s]), `constant` (`wrench` [N, N m]), "
    '`contacts` (`body` of the world, `topic`), `c3d`: see "A recorded trial"',
)
"""The parameter `load`."""


class ContactLoad:
    """The sum of the contact forces on a body of the simulation, straight lines between the instants at which they
    come.

    Args:
        body: the plate's model; its links count.
        T_world_plate: the plate's frame: surface centre, z up.
    """

    def __init__(self, body: str, T_world_plate: Pose) -> None:
        self._body, self._T, self._track = body, T_world_plate, Track(len(CHANNELS))
        self._last = -np.inf

    def __call__(self, times: FloatArray) -> FloatArray:
        """The load."""
        return self._track.at(times)

    def add(self, time: float, contacts: Sequence[tuple[str, str, Sequence[tuple[Vector, Vector]]]]) -> None:
        """Contacts of an instant.

        Args:
            time: of run [s].
            contacts: (first body, second body, (point [m], force on the first body [N]) each), world axes.
        """
        total = np.zeros(len(CHANNELS))
        for first, second, points in contacts:
            for name, sign in ((first, 1.0), (second, -1.0)):
                if name == self._body or name.startswith(f"{self._body}::"):
                    total += sign * sum(
                        (self._wrench(point, force) for point, force in points), np.zeros(len(CHANNELS))
                    )
        if time - self._last > 1.5 * CONTACTS_PERIOD:  # it was silent: nothing touched until one period ago
            self._track.add(time - CONTACTS_PERIOD, np.zeros(len(CHANNELS)))
        self._last = time
        self._track.add(time, total)

    def _wrench(self, point: Vector, force: Vector) -> FloatArray:
        (x, y, z), (qx, qy, qz, qw) = self._T.position, self._T.orientation
        back = (-qx, -qy, -qz, qw)
        return wrench_at(rotated(back, (point[0] - x, point[1] - y, point[2] - z)), rotated(back, force))
