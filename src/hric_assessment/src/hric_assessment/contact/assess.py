"""Whether a contact was within what a person bears: one finding for each episode.

The rules, before all numbers: a force between rigid surfaces is not assessed; no contact with head or face is within
limits; and without the contact's area a force can be above its limit, but a contact is never within, since the pressure
is not known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hric_assessment.contact.episodes import PENALTY, Episode, refusal
from hric_assessment.contact.limits import NOT_PERMITTED, Limit, Limits, Pair
from hric_assessment.contact.speed import check_positive, transfer_energy
from hric_assessment.findings import Finding, Outcome
from hric_assessment.tables import UNITS
from hric_human.contact import RegionContact

FORCE_ONLY = "force within limit, pressure not assessable"


@dataclass(frozen=True)
class Where:
    """Between whom a contact was.

    Attributes:
        regions: of the body that may have been met; empty: the link has none.
        other: what met it.
        kind: of contact; forces of "penalty" alone are assessed.
        area: of the body, one of the table's; None: not known.
        dominant: whether it is on the side of the dominant hand; None: not known.
        contact_area: over which the force acts, the smaller of the robot's and the body's [m^2]; None: not known.
    """

    regions: tuple[str, ...]
    other: str
    kind: str = PENALTY
    area: str | None = None
    dominant: bool | None = None
    contact_area: float | None = None

    @classmethod
    def of(cls, contact: RegionContact) -> "Where":
        """Of a contact of a simulated body."""
        sides = {region.dominant for region in contact.regions}
        dominant = sides.pop() if len(sides) == 1 else None
        names = tuple(region.name for region in contact.regions)
        return cls(names, contact.other, contact.kind, None, dominant, contact.area)

    @property
    def subject(self) -> str:
        """For findings."""
        return f"contact of {self.other} with {' or '.join(self.regions) or 'a link without a region'}"


@dataclass(frozen=True)
class Share:
    """A value over its limit.

    Attributes:
        quantity: for findings.
        value, limit: [N] or [Pa].
        label: of the limit, for findings.
        unit, scale: in which findings show it.
    """

    quantity: str
    value: float
    limit: float
    label: str
    unit: str
    scale: float

    @property
    def ratio(self) -> float:
        """[1]."""
        return self.value / self.limit

    def __str__(self) -> str:
        shown = f"{self.value * self.scale:.1f} of {self.limit * self.scale:.1f} {self.unit}"
        return f"{self.quantity} {shown} ({self.label})"


def assess(episode: Episode | None, where: Where, limits: Limits, signals: Sequence[str] = ()) -> Finding:
    """One finding.

    Args:
        episode: of that contact; None: its force is not known, as that of a rigid one.
        where: between whom.
        limits: what it is held against.
        signals: that the episode comes from, for the finding.

    Raises:
        HricError: a region or an area that does not exist, or an area of contact that is not positive.
    """
    if where.contact_area is not None:
        check_positive("contact_area", where.contact_area, "m^2")
    limit = limits.at(where.regions, where.area, where.dominant)
    outcome, reason, shares = _judged(episode, where, limit, limits)
    values = _values(episode, where, limit) if where.kind == PENALTY else {}
    window = None if episode is None else (episode.whole.begin, episode.whole.end)
    notes = () if episode is None or where.kind != PENALTY else episode.notes
    return Finding(
        where.subject,
        outcome,
        reason,
        limits.table.name,
        max((share.ratio for share in shares), default=None),
        values,
        window,
        tuple(signals),
        _missing(episode, where),
        (*notes, *_marks(limit)),
    )


def _missing(episode: Episode | None, where: Where) -> tuple[str, ...]:
    found = {
        "a force of penalty contact": episode is None or where.kind != PENALTY,
        "the contact's area": where.contact_area is None,
        "the area of the body": where.area is None,
    }
    return tuple(name for name, missing in found.items() if missing)


def _judged(
    episode: Episode | None, where: Where, limit: Limit | None, limits: Limits
) -> tuple[Outcome, str, list[Share]]:
    if any(region in NOT_PERMITTED for region in where.regions):
        known = "" if len(where.regions) == 1 else ", and which of these was met is not known"
        shares = _shares(episode, where, limit) if episode and limit and where.kind == PENALTY else []
        return Outcome.ABOVE, f"no contact with {' or '.join(NOT_PERMITTED)} is within limits{known}", shares
    if where.kind != PENALTY:
        return Outcome.NOT_ASSESSABLE, refusal(where.kind), []
    if limit is None:
        return Outcome.NOT_ASSESSABLE, f"{limits.table.title} has no limit there", []
    if episode is None:
        return Outcome.NOT_ASSESSABLE, "the force is not known", []
    shares = _shares(episode, where, limit)
    largest = max(shares, key=lambda share: share.ratio)
    if largest.ratio > 1.0:
        return Outcome.ABOVE, str(largest), shares
    if limit.missing:
        reason = f"{limits.table.title} has no {' and no '.join(limit.missing)}"
        return Outcome.NOT_ASSESSABLE, f"{reason}; {largest}", shares
    if where.contact_area is None:
        return Outcome.NOT_ASSESSABLE, f"{FORCE_ONLY}: the contact's area is not known; {largest}", shares
    return Outcome.WITHIN, str(largest), shares


def _shares(episode: Episode, where: Where, limit: Limit) -> list[Share]:
    """All values that have a limit; a transient without one is held against the quasi-static one, for information."""
    found = _of_pair("force", episode, 1.0, limit.force, "N", 1.0)
    if where.contact_area is not None and limit.pressure is not None:
        shown = "N/cm^2", 1.0 / UNITS["pressure"]
        found += _of_pair("mean pressure", episode, where.contact_area, limit.pressure, *shown)
    return found


def _of_pair(name: str, episode: Episode, area: float, pair: Pair, unit: str, scale: float) -> list[Share]:
    short = pair.quasi_static if pair.transient is None else pair.transient
    found = [Share(f"transient {name}", episode.transient.peak / area, short, pair.label, unit, scale)]
    if episode.quasi_static is not None:
        value = episode.quasi_static.peak / area
        found.append(Share(f"quasi-static {name}", value, pair.quasi_static, pair.label, unit, scale))
    return found


def _values(episode: Episode | None, where: Where, limit: Limit | None) -> Mapping[str, float | None]:
    if episode is None:
        return {}
    held, area = episode.quasi_static, where.contact_area
    energy = None if limit is None else transfer_energy(episode.whole.peak, limit.stiffness)
    return {
        "transient peak [N]": episode.transient.peak,
        "quasi-static peak [N]": None if held is None else held.peak,
        "duration [s]": episode.whole.duration,
        "quasi-static duration [s]": 0.0 if held is None else held.end - episode.transient.end,
        "impulse [N s]": episode.whole.impulse,
        "energy by the table's spring [J]": energy,
        "work [J]": episode.work,
        "contact area [m^2]": area,
        "transient mean pressure [Pa]": None if area is None else episode.transient.peak / area,
        "quasi-static mean pressure [Pa]": None if area is None or held is None else held.peak / area,
    }


def _marks(limit: Limit | None) -> tuple[str, ...]:
    if limit is None:
        return ()
    pairs = [("force", limit.force), ("pressure", limit.pressure)]
    return tuple(f"limit of the {name}, {pair.label}: {pair.mark}" for name, pair in pairs if pair is not None)
