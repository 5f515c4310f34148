"""Loads on an emulated force plate."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.geometry import Pose, Vector
from hric_core.geometry.quaternions import rotated
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_core.parameters import Settings, number, numbers, text, variant
from hric_human.control.whole_body import WholeBody, floor_wrench
from hric_human.participant.settings import HumanSettings
from hric_perception import simulated
from hric_perception.chunk import FloatArray
from hric_perception.plate.geometry import CHANNELS, wrench_at
from hric_perception.replayed import RecordedLoad, ValueTrack

CONTACTS_PERIOD = 0.01
"""Period of the topic `sim/contacts` [s]; nothing is published while nothing touches."""
CONTACTS_DELAY = 0.03
"""Delay of a sample until the contacts at its time have arrived [s]: two periods and transport.

Project default, unconfirmed.
"""
Load = Callable[[FloatArray], FloatArray]
"""Function from robot times, shape (n,) [s], to the wrench on a plate in its frame, shape (n, 6) [N, N m]."""


@dataclass(frozen=True)
class Push(Settings):
    """Settings of a periodic vertical push on the plate with smooth rise and fall."""

    force: float = number(100.0, minimum=0.0, maximum=1e5, unit="N")
    point: tuple[float, float] = numbers(2, (0.1, 0.05), unit="m")
    period: float = number(2.0, minimum=0.01, maximum=3600.0, unit="s")

    def load(self) -> Load:
        """Return the load as a function of robot time."""
        wrench = wrench_at((*self.point, 0.0), (0.0, 0.0, -self.force))
        return lambda times: 0.5 * (1 - np.cos(2 * np.pi * times / self.period))[:, None] * wrench


@dataclass(frozen=True)
class ConstantLoad(Settings):
    """Settings of a constant load on the plate."""

    wrench: tuple[float, ...] = numbers(len(CHANNELS), (0.0,) * len(CHANNELS), unit="N, N m")

    def load(self) -> Load:
        """Return the load as a function of robot time."""
        wrench = np.array(self.wrench)
        return lambda times: np.tile(wrench, (len(times), 1))


@dataclass(frozen=True)
class Contacts(Settings):
    """Settings of a load that consists of contact forces on a body of the simulation."""

    body: str = text("plate")
    topic: str = text("sim/contacts", valid="a topic of gazebo_msgs/ContactsState", empty=False)


@dataclass(frozen=True)
class StandingBody(Settings):
    """Settings of a load that consists of the simulated human standing on the plate."""


PROGRAM: Any = variant(
    "program",
    {
        "push": Push,
        "constant": ConstantLoad,
        "contacts": Contacts,
        "c3d": RecordedLoad,
        simulated.PROGRAM: StandingBody,
    },
    "push",
    {},
    default_text="`{program: push}`",
    text="`push` (`force` [N], `point` [x, y] [m], `period` [s]), `constant` (`wrench` [N, N m]), "
    '`contacts` (`body` of the world, `topic`), `c3d`: see "A recorded trial", `body`: see "The human in the plant"',
)
"""Parameter `load`: what presses on an emulated plate, chosen by the key `program`."""


class ContactLoad:
    """Sum of the contact forces on a simulated plate, interpolated linearly between messages.

    Args:
        body: name of the plate's model in the simulation; all its links count.
        T_world_plate: pose of the plate's frame (surface centre, z up) in the world.
    """

    def __init__(self, body: str, T_world_plate: Pose) -> None:
        self._body, self._T, self._track = body, T_world_plate, ValueTrack(len(CHANNELS))
        self._last = -np.inf

    def __call__(self, times: FloatArray) -> FloatArray:
        """Return the wrench on the plate in its frame at robot times, shape (n,) [s]: shape (n, 6) [N, N m]."""
        return self._track.at(times)

    def add(self, time: float, contacts: Sequence[tuple[str, str, Sequence[tuple[Vector, Vector]]]]) -> None:
        """Add all contacts of the simulation at one instant.

        Args:
            time: robot time [s].
            contacts: name of the first body, name of the second, and (point [m], force on the first body [N]) of each
                contact point, in world axes, of each pair in contact.
        """
        total = np.zeros(len(CHANNELS))
        for first, second, points in contacts:
            for name, sign in ((first, 1.0), (second, -1.0)):
                if name == self._body or name.startswith(f"{self._body}::"):
                    total += sign * sum(
                        (self._wrench(point, force) for point, force in points), np.zeros(len(CHANNELS))
                    )
        if time - self._last > 1.5 * CONTACTS_PERIOD:  # no message before: nothing touched until one period ago
            self._track.store(time - CONTACTS_PERIOD, np.zeros(len(CHANNELS)))
        self._last = time
        self._track.store(time, total)

    def _wrench(self, point: Vector, force: Vector) -> FloatArray:
        (x, y, z), (qx, qy, qz, qw) = self._T.position, self._T.orientation
        back = (-qx, -qy, -qz, qw)
        return wrench_at(rotated(back, (point[0] - x, point[1] - y, point[2] - z)), rotated(back, force))


class FloorLoad:
    """Load of the simulated human on a force plate in the floor, computed from their motion and grip forces.

    Values are interpolated linearly between messages. Joint accelerations are central differences of the velocities in
    the previous and the next message.

    Args:
        person: section `human` of the experiment.
        T_world_plate: pose of the plate's frame (surface centre, z up) in the world.
    """

    def __init__(self, person: HumanSettings, T_world_plate: Pose) -> None:
        body = person.body()
        self._dynamics, self._T_world_root = WholeBody(body), person.root(body)
        self._R = rotation_from_quaternion(T_world_plate.orientation)
        self._p = np.array(T_world_plate.position)
        self._joints, self._rows = tuple(body.joints), deque[tuple[float, FloatArray, FloatArray]](maxlen=3)
        self._floor = ValueTrack(len(CHANNELS))
        self._grips = {name: ValueTrack(len(CHANNELS)) for name in person.grips}

    @property
    def known(self) -> float:
        """Robot time up to which the load is known [s]; minus infinity if it is unknown."""
        return min(self._floor.known, *(track.known for track in self._grips.values()), np.inf)

    def __call__(self, times: FloatArray) -> FloatArray:
        """Return the wrench on the plate in its frame at robot times, shape (n,) [s]: shape (n, 6) [N, N m]."""
        total = sum((track.at(times) for track in self._grips.values()), self._floor.at(times))
        force, torque = total[:, :3], total[:, 3:]
        return np.hstack([force @ self._R, (torque - np.cross(self._p, force)) @ self._R])

    def add(self, time: float, names: Sequence[str], q: Sequence[float], dq: Sequence[float]) -> None:
        """Add a joint state of the human: robot time [s], joint names, positions [rad], velocities [rad/s]."""
        simulated.check_joints(names, self._joints)
        rows = self._rows
        if rows and time < rows[-1][0]:
            rows.clear()
        elif rows and time == rows[-1][0]:
            rows.pop()
        rows.append((time, np.array(q), np.array(dq)))
        if len(rows) == 3:
            (before, _, dq_before), (at, q_at, dq_at), (after, _, dq_after) = rows
            ddq = (dq_after - dq_before) / (after - before)
            wrench = floor_wrench(self._dynamics, q_at.tolist(), dq_at.tolist(), ddq.tolist(), self._T_world_root)
            self._floor.store(at, np.array(wrench))

    def hold(self, held: simulated.Held) -> None:
        """Store the load of a grip on the human."""
        if held.name in self._grips:
            torque = np.array(held.torque) + np.cross(held.point, held.force)
            self._grips[held.name].store(held.time, np.concatenate([held.force, torque]))
