"""Assessment of one contact of a person against the force and pressure limits of the touched body region.

Rules that hold whatever the numbers are: a force between rigid surfaces is not assessed; no contact with head or face
is within limits; without the contact area a contact can be above limits by its force, but never within limits, since
the pressure is unknown; missing information on a contact prevents "within limits", never "above limits".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hric_assessment.contact.episodes import PENALTY, Episode, refusal
from hric_assessment.contact.limits import NOT_PERMITTED, ContactLimit, LimitPair, Limits
from hric_assessment.contact.speed import check_positive, transfer_energy
from hric_assessment.findings import Finding, Outcome
from hric_assessment.tables import UNITS

FORCE_ONLY = "force within limit, pressure not assessable"
NO_AREA = "state the contact's area: --contact-area M2, or the area of each contact in the recording"


@dataclass(frozen=True)
class ContactSite:
    """Place of a contact: body region of the person, other body, and contact area.

    Attributes:
        regions: body regions of the person that may be in contact; empty: the touched link has none.
        other: name of the body that touches the person.
        kind: kind of contact in the simulation; only forces of "penalty" (spring) contacts are assessed.
        area: specific body area of the limit table, such as a finger pad; None: not known.
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
        """Name of the contact in the findings about it."""
        return f"contact of {self.other} with {' or '.join(self.regions) or 'a link without a region'}"

    @property
    def permitted_regions(self) -> list[str]:
        """Regions of which a contact may be within limits."""
        return [region for region in self.regions if region not in NOT_PERMITTED]


Where = ContactSite
"""Former name of ContactSite, until the next release."""


@dataclass(frozen=True)
class LimitRatio:
    """Force, pressure or speed of a contact together with its limit.

    Attributes:
        quantity: name of the quantity, for findings.
        value, limit: value and limit [N], [Pa] or [m/s].
        label: name of the limit, for findings.
        unit, scale: unit in which findings show the value, and factor from SI to that unit.
        exact: False if the limit is a lower bound of the true one.
    """

    quantity: str
    value: float
    limit: float
    label: str
    unit: str
    scale: float
    exact: bool = True

    @property
    def ratio(self) -> float:
        """Value divided by limit [1]."""
        return self.value / self.limit

    def __str__(self) -> str:
        digits = 3 if self.unit == "m/s" else 1
        shown = f"{self.value * self.scale:.{digits}f} of {self.limit * self.scale:.{digits}f} {self.unit}"
        return f"{self.quantity} {shown} ({self.label})"


def approach_ratio(speed: float, permitted: float, label: str, exact: bool) -> LimitRatio:
    """Compare the approach speed at impact with the speed that ISO/TS 15066 permits.

    The permitted speed uses the standard's effective mass and stiffness of the body region, not those of the simulated
    body.

    Args:
        speed: approach speed along the normal [m/s].
        permitted: permitted speed by ISO/TS 15066, Annex A, for the heavier of the robot's masses [m/s].
        label: masses and region for which the permitted speed was computed, for findings.
        exact: False if the robot's mass is not known, and `permitted` is that for an infinite mass.
    """
    return LimitRatio("speed of approach", speed, permitted, label, "m/s", 1.0, exact)


def assess(
    episode: Episode | None,
    site: ContactSite,
    limits: Limits,
    signals: Sequence[str] = (),
    approach: LimitRatio | None = None,
    *,
    held: bool = False,
) -> Finding:
    """Return the finding about one contact: its outcome, with reason and numbers.

    Args:
        episode: force over time, with the doubts about it; None: the force is not known, as in a rigid contact.
        site: place of the contact.
        limits: limits of the body regions.
        signals: topics from which the contact was recorded, for the finding.
        approach: approach speed at impact and its limit; None: the speed is not judged.
        held: True if the contact counts as quasi-static from its begin.

    Raises:
        HricError: a region or an area does not exist, or the contact area is not positive.
    """
    if site.contact_area is not None:
        check_positive("contact_area", site.contact_area, "m^2")
    limit, doubts = limits.at(site.regions, site.area, site.dominant), () if episode is None else episode.doubts
    limit = limit.held() if limit is not None and held else limit
    force = None if episode is None or site.kind != PENALTY or not episode.known else episode
    outcome, reason, ratios = _judged(force, doubts, site, limit, limits, approach)
    return Finding(
        site.subject,
        outcome,
        reason,
        limits.table.name,
        max((item.ratio for item in ratios), default=None),
        {} if force is None else _values(force, site, limit),
        None if episode is None else (episode.overall.begin, episode.overall.end),
        tuple(signals),
        _missing(force, site),
        (*(() if force is None else force.notes), *doubts, *_marks(limit)),
        remedy=NO_AREA if reason.startswith(FORCE_ONLY) else "",
    )


def _missing(force: Episode | None, site: ContactSite) -> tuple[str, ...]:
    lacks = {
        "a force of penalty contact": force is None,
        "the contact's area": site.contact_area is None,
        "the area of the body": site.area is None,
    }
    return tuple(name for name, missing in lacks.items() if missing)


def _judged(
    force: Episode | None,
    doubts: Sequence[str],
    site: ContactSite,
    limit: ContactLimit | None,
    limits: Limits,
    approach: LimitRatio | None,
) -> tuple[Outcome, str, list[LimitRatio]]:
    ratios = _ratios(force, site, limit) if force and limit else []
    if approach is not None and site.kind == PENALTY and (approach.exact or approach.value <= approach.limit):
        ratios.append(approach)
    if any(region in NOT_PERMITTED for region in site.regions):
        known = "" if len(site.regions) == 1 else ", and which of these was touched is not known"
        return Outcome.ABOVE, f"no contact with {' or '.join(NOT_PERMITTED)} is within limits{known}", ratios
    if site.kind != PENALTY:
        return Outcome.NOT_ASSESSABLE, refusal(site.kind), []
    if limit is None:
        return Outcome.NOT_ASSESSABLE, f"{limits.table.title} has no limit there", []
    largest = max(ratios, key=lambda item: item.ratio, default=None)
    if largest is not None and largest.ratio > 1.0:
        return Outcome.ABOVE, str(largest), ratios
    if why := _unproven(force, doubts, site, limit, limits, approach):
        return Outcome.NOT_ASSESSABLE, why if largest is None else f"{why}; {largest}", ratios
    return Outcome.WITHIN, str(largest), ratios


def _unproven(
    force: Episode | None,
    doubts: Sequence[str],
    site: ContactSite,
    limit: ContactLimit,
    limits: Limits,
    approach: LimitRatio | None,
) -> str:
    """Return the reason why a contact below its limits cannot be called within limits; empty: it can."""
    if doubts:
        return "; ".join(doubts)
    if force is None:
        return "the force is not known"
    if limit.missing:
        return f"{limits.table.title} has no {' and no '.join(limit.missing)}"
    if site.contact_area is None:
        return f"{FORCE_ONLY}: the contact's area is not known"
    peak = force.unknown_peak
    if peak is not None and max(item.ratio for item in _of_pair(0.0, peak, site.contact_area, limit)) > 1.0:
        return f"the force is not known for a part of the time, and may have been up to {peak:.1f} N then"
    if approach is not None and approach.value > approach.limit:
        return f"{approach}, and the robot's mass there is not known"
    return ""


def _ratios(force: Episode, site: ContactSite, limit: ContactLimit) -> list[LimitRatio]:
    """Return all forces and pressures with their limits.

    A transient value without a transient limit is compared with the quasi-static one.
    """
    held = None if force.quasi_static is None else force.quasi_static.peak
    return _of_pair(force.transient.peak, held, site.contact_area, limit)


def held_ratio(force: float, limit: ContactLimit) -> LimitRatio:
    """Return a force that is held [N] with the limit of a quasi-static contact."""
    return LimitRatio("quasi-static force", force, limit.force.quasi_static, limit.force.label, "N", 1.0)


def _of_pair(peak: float, held: float | None, area: float | None, limit: ContactLimit) -> list[LimitRatio]:
    ratios = _pair("force", peak, held, limit.force, "N", 1.0)
    if area is not None and limit.pressure is not None:
        over_area = None if held is None else held / area
        ratios += _pair("mean pressure", peak / area, over_area, limit.pressure, "N/cm^2", 1.0 / UNITS["pressure"])
    return ratios


def _pair(name: str, peak: float, held: float | None, pair: LimitPair, unit: str, scale: float) -> list[LimitRatio]:
    short = pair.quasi_static if pair.transient is None else pair.transient
    ratios = [LimitRatio(f"transient {name}", peak, short, pair.label, unit, scale)]
    if held is not None:
        ratios.append(LimitRatio(f"quasi-static {name}", held, pair.quasi_static, pair.label, unit, scale))
    return ratios


def _values(force: Episode, site: ContactSite, limit: ContactLimit | None) -> Mapping[str, float | None]:
    held, area = force.quasi_static, site.contact_area
    energy = None if limit is None else transfer_energy(force.overall.peak, limit.stiffness)
    return {
        "transient peak [N]": force.transient.peak,
        "quasi-static peak [N]": None if held is None else held.peak,
        "duration [s]": force.overall.duration,
        "quasi-static duration [s]": 0.0 if held is None else held.end - force.transient.end,
        "impulse [N s]": force.overall.impulse,
        "energy by the table's spring [J]": energy,
        "contact area [m^2]": area,
        "transient mean pressure [Pa]": None if area is None else force.transient.peak / area,
        "quasi-static mean pressure [Pa]": None if area is None or held is None else held.peak / area,
    }


def _marks(limit: ContactLimit | None) -> tuple[str, ...]:
    if limit is None:
        return ()
    pairs = [("force", limit.force), ("pressure", limit.pressure)]
    return tuple(f"limit of the {name}, {pair.label}: {pair.mark}" for name, pair in pairs if pair is not None)
