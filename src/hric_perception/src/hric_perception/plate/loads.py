"""What presses on an emulated force plate. No ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hric_perception.chunk import FloatArray
from hric_perception.plate.geometry import CHANNELS, wrench_at
from hric_perception.section import Section
from hric_perception.track import Track
from mocap_natnet.codec.types import Vector
from mocap_natnet.poses import Pose, rotate

PROGRAMS = ("push", "constant", "contacts", "c3d")
CONTACTS_EVERY = 0.01
"""Period of `sim/contacts` [s]; it is silent while nothing touches."""
CONTACTS_DELAY = 0.03
"""So long after a sample was taken its contacts are known [s] (our choice: two periods, and the way)."""

Load = Callable[[FloatArray], FloatArray]
"""Run times, shape (n,) [s] -> wrench on the plate in its frame, shape (n, 6) [N, N m]."""


def read_load(section: Section) -> Load:
    """The load of a mapping; `contacts` and `c3d` are not among them. Raises HricError."""
    if section.text("program", "push", PROGRAMS) == "constant":
        section.only("program", "wrench")
        wrench = np.array(section.numbers(f"{section.where}.wrench", section.content.get("wrench", [0.0] * 6), (len(CHANNELS),)))
        return lambda times: np.tile(wrench, (len(times), 1))
    section.only("program", "force", "point", "period")
    force, period = section.number("force", 100.0, 0.0, 1e5), section.number("period", 2.0, 0.01, 3600.0)
    x, y = Section.numbers(f"{section.where}.point", section.content.get("point", [0.1, 0.05]), (2,))
    wrench = wrench_at((x, y, 0.0), (0.0, 0.0, -force))
    return lambda times: 0.5 * (1 - np.cos(2 * np.pi * times / period))[:, None] * wrench


class ContactLoad:
    """The sum of the contact forces on a body of the simulation, as they are told; straight lines between the instants.

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
                    total += sign * sum((self._wrench(point, force) for point, force in points), np.zeros(len(CHANNELS)))
        if time - self._last > 1.5 * CONTACTS_EVERY:  # it was silent: nothing touched until one period ago
            self._track.add(time - CONTACTS_EVERY, np.zeros(len(CHANNELS)))
        self._last = time
        self._track.add(time, total)

    def _wrench(self, point: Vector, force: Vector) -> FloatArray:
        (x, y, z), (qx, qy, qz, qw) = self._T.position, self._T.orientation
        back = (-qx, -qy, -qz, qw)
        return wrench_at(rotate(back, (point[0] - x, point[1] - y, point[2] - z)), rotate(back, force))
