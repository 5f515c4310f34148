"""Contacts of a human body, by region of ISO/TS 15066, from the contacts that a plant reports.

A contact has a force only if the pair of bodies is elastic (`hric_human.body.surfaces`). The force that stops a rigid
pair within one step of the engine is not a force on a person: such a contact is called a touch, and has no force.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hric_control.plant import Contact
from hric_core.geometry import FloatArray, Vector
from hric_human.body.description import Body
from hric_human.body.segments import side_of

Pair = tuple[str, str]
"""Two bodies, "model::link" each."""


@dataclass(frozen=True)
class ContactSeries:
    """Time series of a contact at the instants of its recorded messages; values as recorded, NaN included.

    Attributes:
        time: robot time, shape (n,) [s].
        force: contact force, shape (n,) [N].
        reached: largest force of all cycles since the contact began, shape (n,) [N].
        reached_time: robot time of the largest force, shape (n,) [s].
        since_begin: time since the contact began, as stated in the message, shape (n,) [s].
        point: contact point, world frame, shape (n, 3) [m].
        normal: unit vector along which the force acts on the body, world frame, shape (n, 3).
    """

    time: FloatArray
    force: FloatArray
    reached: FloatArray
    reached_time: FloatArray
    since_begin: FloatArray
    point: FloatArray
    normal: FloatArray


NO_SERIES = ContactSeries(*(np.empty(0) for _ in range(5)), *(np.empty((0, 3)) for _ in range(2)))
"""Empty time series, for a contact that was not recorded."""


@dataclass
class RegionContact:
    """Contact of one link of a body with one other body, from the first touch to separation or the end of recording.

    In a run, `RegionContacts` updates it; from a bag, `hric_bags` builds it. Times are robot times.

    Attributes:
        link: link of the body.
        regions: regions of ISO/TS 15066 that the link belongs to; if several, the touched one is unknown. Empty for a
            foot.
        other: body that touches the link, "model::link".
        kind: "penalty", or "rigid": a touch without a force.
        begin: time of the first update with the contact [s].
        duration: time from the first to the last update with the contact [s].
        dominant: True on the side of the dominant hand; None if the recorded messages disagree.
        force: force in the last step in contact [N]; None for a touch.
        peak: largest force [N]; None for a touch.
        peak_time: time of the update with the peak [s]; None for a touch.
        impulse: impulse of the normal force [N s]; None for a touch.
        energy: largest work that both bodies have done on the contact since it began [J]; None for a touch, and if
            unknown.
        area: smallest contact area [m^2]; None: not known, since a capsule touches in a point or along a line.
        point: contact point in the last step in contact, world frame [m]; of several points the one with the largest
            force, else the deepest; None if the contact fell between two updates.
        normal: unit vector at that point along which the force on the body acts, world frame; None like `point`.
        begin_point, begin_normal: point and normal at the first update with the contact.
        begin_speed: closing speed along the normal at first contact [m/s]; None for a touch, and if unknown.
        series: time series with one row for each recorded message that has the contact.
        ended: True if a recorded message reports the separation.
        interrupted: True if, between two messages with the contact, others report neither the contact nor its end.
    """

    link: str
    regions: tuple[str, ...]
    other: str
    kind: str
    begin: float
    duration: float = 0.0
    dominant: bool | None = False
    force: float | None = None
    peak: float | None = None
    peak_time: float | None = None
    impulse: float | None = None
    energy: float | None = None
    area: float | None = None
    point: Vector | None = None
    normal: Vector | None = None
    begin_point: Vector | None = None
    begin_normal: Vector | None = None
    begin_speed: float | None = None
    series: ContactSeries = NO_SERIES
    ended: bool = False
    interrupted: bool = False

    @property
    def end(self) -> float:
        """Time of the last update with the contact [s]."""
        return self.begin + self.duration

    @property
    def side(self) -> str:
        """Side of the link: "right", "left", or "" (middle)."""
        return side_of(self.link)

    def reach(self, time: float, peak: float) -> None:
        """Store a force [N] and its time [s] if it exceeds the stored peak."""
        if self.peak is None or peak > self.peak:
            self.peak, self.peak_time = peak, time

    def locate(self, contact: Contact, towards: float) -> None:
        """Store point and normal of a contact; towards: 1 if its normal points along the force on the body, else -1."""
        x, y, z = contact.normal
        self.point, self.normal = contact.position, (towards * x, towards * y, towards * z)
        if self.begin_point is None:
            self.begin_point, self.begin_normal, self.begin_speed = self.point, self.normal, contact.closing


class RegionContacts:
    """Contacts of one body with everything else in the plant, link by link.

    Args:
        body: body as it was spawned.
        model: name of the body's model in the plant.

    Attributes:
        present: contacts at the last update, by the body's link and the other body, each "model::link".
    """

    def __init__(self, body: Body, model: str) -> None:
        self._model = f"{model}::"
        self._regions = {
            self._model + link: (tuple(region.name for region in regions), any(region.dominant for region in regions))
            for link, regions in body.regions.items()
        }
        self.present: dict[Pair, RegionContact] = {}

    def update(
        self, time: float, contacts: Sequence[Contact], peaks: Mapping[Pair, float] = {}, steps: int = 1
    ) -> list[RegionContact]:
        """Update the contacts; call after each step of the plant, or every few steps.

        Args:
            time: time after the step [s].
            contacts: contacts of the step, as `Plant.contacts` returns them.
            peaks: peak forces since the last update, as `Plant.take_contact_peaks` returns them [N]; not needed if the
                update follows each step, since the contacts then contain their peaks.
            steps: steps of the plant since the last update; the impulse is assumed to be the same in each.

        Returns:
            contacts that ended, each once; includes contacts that began and ended between two updates, of which only
                the peak is known.
        """
        if not (contacts or peaks or self.present):
            return []
        before, self.present = self.present, {}
        strongest: dict[Pair, Contact] = {}
        for contact in contacts:
            for pair in self._pairs(contact.body_a, contact.body_b):
                strongest[pair] = max(strongest.get(pair, contact), contact, key=_strength)
                present = before.pop(pair, None) or self.present.get(pair) or self._new(pair, contact.kind, time)
                self.present[pair], present.duration = present, time - present.begin
                if contact.kind == "penalty":
                    present.force = contact.force
                    present.impulse = (present.impulse or 0.0) + steps * contact.impulse
                    if contact.energy is not None:
                        present.energy = max(present.energy or 0.0, contact.energy)
                    present.reach(time, contact.force)
        for pair, contact in strongest.items():
            self.present[pair].locate(contact, 1.0 if contact.body_a == pair[0] else -1.0)
        for bodies, peak in peaks.items():
            for pair in self._pairs(*bodies):
                reached = self.present.get(pair) or before.setdefault(pair, self._new(pair, "penalty", time))
                reached.reach(time, peak)
        return list(before.values())

    def _pairs(self, a: str, b: str) -> Iterator[Pair]:
        """Yield (link of the body, other body) for two touching links; nothing if both or neither are of the body."""
        for link, other in ((a, b), (b, a)):
            if link in self._regions and not other.startswith(self._model):
                yield link, other

    def _new(self, pair: Pair, kind: str, time: float) -> RegionContact:
        link, other = pair
        regions, dominant = self._regions[link]
        return RegionContact(link.removeprefix(self._model), regions, other, kind, time, dominant=dominant)


def _strength(contact: Contact) -> tuple[float, float]:
    """Return the sort key that selects the dominant of several contact points: force, then depth."""
    return contact.force, contact.depth
