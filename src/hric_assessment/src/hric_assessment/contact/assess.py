"""Assessment of one contact of a person against the limits of its body region.

The rules, before all numbers: a force between rigid surfaces is not assessed; no contact with head or face is within
limits; without the contact area a force can be above its limit, but a contact is never within limits, since the
pressure is unknown; and missing information on a contact prevents "within limits", never "above limits".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hric_assessment.contact.episodes import PENALTY, Episode, refusal
from hric_assessment.contact.limits import NOT_PERMITTED, Limit, Limits, Pair
from hric_assessment.contact.speed import check_positive, transfer_energy
from hric_assessment.findings import Finding, Outcome
from hric_assessment.tables import UNITS

FORCE_ONLY = "force within limit, pressure not assessable"
NO_AREA = "state the contact's area: --contact-area M2, or the area of each contact in the recording"


@dataclass(frozen=True)
class Where:
    """The two bodies of a contact and where they touch.

    Attributes:
        regions: body regions of the person that may be in contact; empty: the link has none.
        other: name of the body that touches the person.
        kind: kind of contact; only forces of "penalty" are assessed.
        area: body area in the limit table; None: not known.
        dominant: True on the side of the dominant hand; None: not known.
        contact_area: area over which the force acts, the smaller of the robot's and the body's [m^2]; None: not known.
    """

    regions: tuple[str, ...]
    other: str
    kind: str = PENALTY
    area: str | None = None
    dominant: bool | None = None
    contact_area: float | None = None

    @property
    def subject(self) -> str:
        """Subject line of findings about this contact."""
        return f"contact of {self.other} with {' or '.join(self.regions) or 'a link without a region'}"


@dataclass(frozen=True)
class Share:
    """Value of a contact with its limit.

    Attributes:
        quantity: name of the quantity, for findings.
        value, limit: value and limit [N], [Pa] or [m/s].
        label: name of the limit, for findings.
        unit, scale: unit in which findings show the value, and factor from SI to that unit.
    """

    quantity: str
    value: float
    limit: float
    label: str
    unit: str
    scale: float

    @property
    def ratio(self) -> float:
        """Value divided by limit [1]."""
        return self.value / self.limit

    def __str__(self) -> str:
        digits = 3 if self.unit == "m/s" else 1
        shown = f"{self.value * self.scale:.{digits}f} of {self.limit * self.scale:.{digits}f} {self.unit}"
        return f"{self.quantity} {shown} ({self.label})"


@dataclass(frozen=True)
class Approach:
    """Approach speed at impact, compared with the permitted speed for the standard's body mass and stiffness.

    The standard's mass and spring replace those of the simulated body.

    Attributes:
        speed: approach speed along the normal [m/s].
        permitted: permitted speed by ISO/TS 15066, Annex A, for the heavier of the robot's masses [m/s].
        label: masses and region that the permitted speed follows from.
        exact: False: the robot's mass is not known, and `permitted` is that of an infinitely heavy one.
    """

    speed: float
    permitted: float
    label: str
    exact: bool

    @property
    def share(self) -> Share:
        """Approach speed with its permitted value."""
        return Share("speed of approach", self.speed, self.permitted, self.label, "m/s", 1.0)


@dataclass(frozen=True)
class Unknown:
    """Missing information on a contact.

    Attributes:
        doubts: clauses; each prevents a contact from being within limits.
        peak: upper bound of the quasi-static force where samples are missing [N]; None: no sample is missing.
    """

    doubts: tuple[str, ...] = ()
    peak: float | None = None


ALL_KNOWN = Unknown()


def assess(
    episode: Episode | None,
    where: Where,
    limits: Limits,
    signals: Sequence[str] = (),
    unknown: Unknown = ALL_KNOWN,
    approach: Approach | None = None,
) -> Finding:
    """Return the finding of one contact.

    Args:
        episode: force over time; None: the force is not known, as in a rigid contact.
        where: the two bodies.
        limits: limits of the person.
        signals: topics from which the episode was recorded, for the finding.
        unknown: missing information on the contact.
        approach: approach speed at impact; None: not judged.

    Raises:
        HricError: a region or an area that does not exist, or a contact area that is not positive.
    """
    if where.contact_area is not None:
        check_positive("contact_area", where.contact_area, "m^2")
    limit = limits.at(where.regions, where.area, where.dominant)
    outcome, reason, shares = _judged(episode, where, limit, limits, unknown, approach)
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
        (*notes, *unknown.doubts, *_marks(limit)),
        remedy=NO_AREA if reason.startswith(FORCE_ONLY) else "",
    )


def _missing(episode: Episode | None, where: Where) -> tuple[str, ...]:
    lacks = {
        "a force of penalty contact": episode is None or where.kind != PENALTY,
        "the contact's area": where.contact_area is None,
        "the area of the body": where.area is None,
    }
    return tuple(name for name, missing in lacks.items() if missing)


def _judged(
    episode: Episode | None,
    where: Where,
    limit: Limit | None,
    limits: Limits,
    unknown: Unknown,
    approach: Approach | None,
) -> tuple[Outcome, str, list[Share]]:
    shares = _shares(episode, where, limit) if episode and limit and where.kind == PENALTY else []
    if approach is not None and where.kind == PENALTY and (approach.exact or approach.speed <= approach.permitted):
        shares.append(approach.share)
    if any(region in NOT_PERMITTED for region in where.regions):
        known = "" if len(where.regions) == 1 else ", and which of these was met is not known"
        return Outcome.ABOVE, f"no contact with {' or '.join(NOT_PERMITTED)} is within limits{known}", shares
    if where.kind != PENALTY:
        return Outcome.NOT_ASSESSABLE, refusal(where.kind), []
    if limit is None:
        return Outcome.NOT_ASSESSABLE, f"{limits.table.title} has no limit there", []
    largest = max(shares, key=lambda share: share.ratio, default=None)
    if largest is not None and largest.ratio > 1.0:
        return Outcome.ABOVE, str(largest), shares
    if why := _unproven(episode, where, limit, limits, unknown, approach):
        return Outcome.NOT_ASSESSABLE, why if largest is None else f"{why}; {largest}", shares
    return Outcome.WITHIN, str(largest), shares


def _unproven(
    episode: Episode | None,
    where: Where,
    limit: Limit,
    limits: Limits,
    unknown: Unknown,
    approach: Approach | None,
) -> str:
    """Return why a contact below its limits is not proven to be within limits; empty: it is proven."""
    if unknown.doubts:
        return "; ".join(unknown.doubts)
    if episode is None:
        return "the force is not known"
    if limit.missing:
        return f"{limits.table.title} has no {' and no '.join(limit.missing)}"
    if where.contact_area is None:
        return f"{FORCE_ONLY}: the contact's area is not known"
    peak = unknown.peak
    if peak is not None and max(share.ratio for share in _of_pair(0.0, peak, where.contact_area, limit)) > 1.0:
        return f"the force is not known for a part of the time, and may have been {peak:.1f} N there"
    if approach is not None and approach.speed > approach.permitted:
        return f"{approach.share}, and the robot's mass there is not known"
    return ""


def _shares(episode: Episode, where: Where, limit: Limit) -> list[Share]:
    """Return all values that have a limit; a transient value without one is compared with the quasi-static limit."""
    held = None if episode.quasi_static is None else episode.quasi_static.peak
    return _of_pair(episode.transient.peak, held, where.contact_area, limit)


def _of_pair(peak: float, held: float | None, area: float | None, limit: Limit) -> list[Share]:
    found = _pair("force", peak, held, limit.force, "N", 1.0)
    if area is not None and limit.pressure is not None:
        over_area = None if held is None else held / area
        found += _pair("mean pressure", peak / area, over_area, limit.pressure, "N/cm^2", 1.0 / UNITS["pressure"])
    return found


def _pair(name: str, peak: float, held: float | None, pair: Pair, unit: str, scale: float) -> list[Share]:
    short = pair.quasi_static if pair.transient is None else pair.transient
    found = [Share(f"transient {name}", peak, short, pair.label, unit, scale)]
    if held is not None:
        found.append(Share(f"quasi-static {name}", held, pair.quasi_static, pair.label, unit, scale))
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
        "contact area [m^2]": area,
        "transient mean pressure [Pa]": None if area is None else episode.transient.peak / area,
        "quasi-static mean pressure [Pa]": None if area is None or held is None else held.peak / area,
    }


def _marks(limit: Limit | None) -> tuple[str, ...]:
    if limit is None:
        return ()
    pairs = [("force", limit.force), ("pressure", limit.pressure)]
    return tuple(f"limit of the {name}, {pair.label}: {pair.mark}" for name, pair in pairs if pair is not None)
