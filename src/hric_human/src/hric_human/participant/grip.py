"""Grips, by which a human or robot link holds an object in the plant: when they close and open, and their load."""

import math
from collections.abc import Callable

import numpy as np

from hric_control.plant import Articulated, Bushing, BushingLoad
from hric_core.errors import CommandError
from hric_core.geometry import FloatArray, Vector, homogeneous
from hric_core.geometry.transforms import inverse
from hric_human.participant.settings import GripSettings

Happened = Callable[[str, str, float, str], None]
"""Callback for an event, with its kind, name, value (for grips the force [N]) and text."""
LOOK = 10
"""Number of cycles between two checks of the distance between palm and handle (project default, unconfirmed)."""
NOTHING = BushingLoad((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0)


class Grip:
    """Grip of one body on another: a spring and damper (bushing) between palm and handle while it is closed.

    Args:
        name: name of the grip.
        settings: parameters of the grip.
        plant: plant that contains both bodies.
        holder: full name of the body that holds, "model::link".
        palm: position of the palm in axes of the holder's link [m].
        happened: callback for each event.

    Attributes:
        closed: True while the grip holds.
        load: load on the holder in the last step; the opposite load acts on the held body.
    """

    def __init__(
        self, name: str, settings: GripSettings, plant: Articulated, holder: str, palm: Vector, happened: Happened
    ) -> None:
        self.name, self.settings, self.holder = name, settings, holder
        self._plant, self._happened = plant, happened
        self._T_palm = homogeneous(np.eye(3), palm)
        self._T_handle = homogeneous(np.eye(3), settings.handle)
        self.distance()  # raises UnknownNameError if a body does not exist
        self.restart()

    def restart(self) -> None:
        """Release the held body and reset the grip to its state before the first cycle."""
        if self.name in self._plant.connections():
            self._plant.disconnect(self.name)
        self.closed, self.load = False, NOTHING
        self._waits = not self.settings.close.by_service
        self._due, self._slipped, self._slips, self._cycles = math.inf, 0.0, False, 0

    def distance(self) -> float:
        """Return the current distance between palm and handle [m]. Raises UnknownNameError if a body does not exist."""
        palm, handle = self._frames()
        return float(np.linalg.norm(palm[:3, 3] - handle[:3, 3]))

    def _frames(self) -> tuple[FloatArray, FloatArray]:
        state = self._plant.link_state
        return state(self.holder)[0] @ self._T_palm, state(self.settings.held)[0] @ self._T_handle

    def step(self, time: float, since: float) -> None:
        """Close or open the grip if the condition for that is satisfied.

        Args:
            time: robot time [s].
            since: time since the start of the motion [s]; 0 before it.
        """
        if self.closed:
            self._carry(time, since)
        elif self._waits and since >= self.settings.close.time:
            if self._cycles % LOOK == 0 and self.distance() <= self.settings.close.distance:
                self.close()
            self._cycles += 1

    def close(self) -> None:
        """Close the grip from the next step on.

        Raises:
            CommandError: the grip is closed already, or palm and handle are too far apart.
        """
        settings = self.settings
        if self.closed:
            raise CommandError(f"grip {self.name} already holds {settings.held}")
        palm, handle = self._frames()
        distance = float(np.linalg.norm(palm[:3, 3] - handle[:3, 3]))
        if distance > settings.close.distance:
            raise CommandError(
                f"grip {self.name}: {self.holder} is {distance:.3f} m from the handle of {settings.held}; valid: up to "
                f"{settings.close.distance:g} m"
            )
        # The spring is relaxed at the current pose, since a hand adapts to an object where it is. The force acts at the
        # handle: with a lever arm, a force that is constant over a step would make a thin object vibrate.
        T_holder_handle = inverse(palm @ inverse(self._T_palm)) @ handle
        self._plant.connect(
            self.name,
            Bushing(
                self.holder,
                settings.held,
                T_holder_handle,
                self._T_handle,
                settings.stiffness,
                settings.damping,
                settings.rotational_stiffness,
                settings.rotational_damping,
                settings.force_limit or math.inf,
                settings.torque_limit or math.inf,
            ),
        )
        self.closed, self._slipped, self._slips = True, 0.0, False
        self._happened(
            "closed", self.name, 0.0, f"{self.holder} holds {settings.held}, {distance:.3f} m from its handle"
        )

    def open(self, why: str) -> None:
        """Open the grip.

        Args:
            why: reason, for the event's text.

        Raises:
            CommandError: the grip is open already.
        """
        if not self.closed:
            raise CommandError(f"grip {self.name} is open: it holds nothing")
        force = math.hypot(*self.load.force)
        self._plant.disconnect(self.name)
        self.closed, self._waits, self._due, self.load = False, False, math.inf, NOTHING
        self._happened("released", self.name, force, f"{self.holder} releases {self.settings.held}: {why}")

    def _carry(self, time: float, since: float) -> None:
        load = self.load = self._plant.bushing_load(self.name)
        release, force, slips = self.settings.release, math.hypot(*load.force), load.slipped > self._slipped
        if slips and not self._slips:
            self._happened("slipped", self.name, force, f"grip {self.name} slips at a force of {force:.1f} N")
        self._slips, self._slipped = slips, load.slipped
        if release.load is not None and force >= release.load and self._due == math.inf:
            self._due = time + release.delay
        if time >= self._due:
            self.open(f"the grip's force reached {release.load:g} N {release.delay:g} s ago")
        elif release.time is not None and since >= release.time:
            self.open(f"{release.time:g} s have passed since the start of the motion")
