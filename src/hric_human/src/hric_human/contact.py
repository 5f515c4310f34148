"""Contact of a body by regions, from what a plant reports: who touches it where, since when, how hard.

A force is one only where the pair meets by a spring (`hric_human.body.surfaces`). What stops a rigid pair within a step
of the engine is no force on a person: such a contact is a touch, without a force.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from hric_control.geometry import Vector
from hric_control.plant import Contact
from hric_human.body.description import Body
from hric_human.body.regions import Region

Pair = tuple[str, str]
"""Two bodies, "model::link" each."""


@dataclass
class RegionContact:
    """One link of a body and what touches it, from when they met until they parted.

    Attributes:
        link: of the body.
        regions: of ISO/TS 15066 that the link belongs to; which of several was met is not known. Empty of a foot.
        other: what touches it, "model::link".
        kind: "penalty", or "rigid": a touch without a force.
        begin: of the first call with it [s].
        end: of the last call with it [s].
        force: in the last step with it; None of a touch [N].
        peak: largest force; None of a touch [N].
        peak_time: of the call with it; None of a touch [s].
        impulse: of the normal force; None of a touch [N s].
        area: None: a capsule meets others in a point or along a line, and engines report no area [m^2].
        point: where they touch, in the last step with it: of several points that of the largest force, else the
            deepest; world frame; None where the contact was between two calls [m].
        normal: unit vector there along which the force on the body acts, world frame; None likewise.
        begin_point, begin_normal: those of the first call with it.
        begin_speed: along the normal at which both met; None of a touch, and where it is not known [m/s].
    """

    link: str
    regions: tuple[Region, ...]
    other: str
    kind: str
    begin: float
    end: float
    force: float | None = None
    peak: float | None = None
    peak_time: float | None = None
    impulse: float | None = None
    area: float | None = None
    point: Vector | None = None
    normal: Vector | None = None
    begin_point: Vector | None = None
    begin_normal: Vector | None = None
    begin_speed: float | None = None

    @property
    def duration(self) -> float:
        """Between the first and the last call with it [s]."""
        return self.end - self.begin

    def reach(self, time: float, peak: float) -> None:
        """Keep the largest of the forces [N] and its time [s]."""
        if self.peak is None or peak > self.peak:
            self.peak, self.peak_time = peak, time

    def locate(self, contact: Contact, towards: float) -> None:
        """Be where a contact of the plant is; towards: 1 where its normal is that of the force on the body, else -1."""
        x, y, z = contact.normal
        self.point, self.normal = contact.position, (towards * x, towards * y, towards * z)
        if self.begin_point is None:
            self.begin_point, self.begin_normal, self.begin_speed = self.point, self.normal, contact.closing


class RegionContacts:
    """Contacts of one body with all that is not itself, link by link.

    Args:
        body: as it was spawned.
        model: its name in the plant.

    Attributes:
        present: those of the last call, by "model::link" of the body and of what touches it.
    """

    def __init__(self, body: Body, model: str) -> None:
        self._model = f"{model}::"
        self._regions = {self._model + link: regions for link, regions in body.regions.items()}
        self.present: dict[Pair, RegionContact] = {}

    def update(
        self, time: float, contacts: Sequence[Contact], peaks: Mapping[Pair, float] = {}, steps: int = 1
    ) -> list[RegionContact]:
        """To be called after each step of the plant, or each few.

        Args:
            time: after the step [s].
            contacts: of the step, as `Plant.contacts` has them.
            peaks: since the call before, as `Plant.take_contact_peaks` has them [N]; not needed where no step lies
                between two calls, since contacts then have their peaks themselves.
            steps: of the plant since the call before; the impulse is taken to have been the same in each.

        Returns:
            those that ended, each once; also what met and parted between two calls, of which the peak alone is known.
        """
        if not (contacts or peaks or self.present):
            return []
        before, self.present = self.present, {}
        strongest: dict[Pair, Contact] = {}
        for contact in contacts:
            for pair in self._pairs(contact.body_a, contact.body_b):
                strongest[pair] = max(strongest.get(pair, contact), contact, key=_strength)
                found = before.pop(pair, None) or self.present.get(pair) or self._new(pair, contact.kind, time)
                self.present[pair], found.end = found, time
                if contact.kind == "penalty":
                    found.force = contact.force
                    found.impulse = (found.impulse or 0.0) + steps * contact.impulse
                    found.reach(time, contact.force)
        for pair, contact in strongest.items():
            self.present[pair].locate(contact, 1.0 if contact.body_a == pair[0] else -1.0)
        for bodies, peak in peaks.items():
            for pair in self._pairs(*bodies):
                found = self.present.get(pair) or before.setdefault(pair, self._new(pair, "penalty", time))
                found.reach(time, peak)
        return list(before.values())

    def _pairs(self, a: str, b: str) -> Iterator[Pair]:
        """(link of the body, what touches it), of two bodies that touch; none where both or neither are of the body."""
        for own, other in ((a, b), (b, a)):
            if own in self._regions and not other.startswith(self._model):
                yield own, other

    def _new(self, pair: Pair, kind: str, time: float) -> RegionContact:
        own, other = pair
        return RegionContact(own.removeprefix(self._model), self._regions[own], other, kind, time, time)


def _strength(contact: Contact) -> tuple[float, float]:
    """Of several points the one that counts has most of it."""
    return contact.force, contact.depth
