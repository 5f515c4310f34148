"""Findings of contacts: every episode of a person with another body, beside the closed form."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hric_assessment.contact.assess import Where, assess
from hric_assessment.contact.episodes import PENALTY, Episode, episodes
from hric_assessment.contact.impact import Beside, Transient
from hric_assessment.contact.limits import NOT_PERMITTED
from hric_assessment.contact.speed import BothMasses, both_masses, permitted_speed
from hric_assessment.findings import Finding, NotAssessableError, Outcome
from hric_assessment.tables import episode_table
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.person import Person
from hric_assessment.verdict.result import warned
from hric_bags.records.region_contacts import RegionForce
from hric_control import urdf
from hric_control.errors import HricError
from hric_control.geometry import FloatArray

GROUP = "contact"
TOPIC = "human/contacts"


def contact_findings(given: Given, person: Person | None, choices: Choices) -> list[Finding]:
    """Of all contacts of the simulated human; of a run in which he met nothing one that says so."""
    human = given.recording.human
    if human is None:
        return []
    signals = [topic for topic in given.recording.topics if topic.endswith(TOPIC)]
    if not human.meetings:
        return _none(given, choices, signals)
    expected = Expected(given, choices)
    pairs: dict[tuple[str, str], list[RegionForce]] = {}
    for met in human.meetings:
        pairs.setdefault((met.link, met.other), []).append(met)
    return [finding for met in pairs.values() for finding in _of_pair(met, person, expected, choices, signals)]


def _none(given: Given, choices: Choices, signals: Sequence[str]) -> list[Finding]:
    """The plant reports contacts of its human; a bag alone does not say that it did."""
    if not given.definition.get("human"):
        return []
    window = given.recording.begin, given.recording.end
    reason, table = "nothing touched the person in the whole run", choices.limits.table.name
    return [Finding("contacts", Outcome.WITHIN, reason, table, 0.0, {}, window, tuple(signals), group=GROUP)]


def _of_pair(
    met: Sequence[RegionForce], person: Person | None, expected: "Expected", choices: Choices, signals: Sequence[str]
) -> list[Finding]:
    rigid = [one for one in met if one.kind != PENALTY]
    found = [_rigid(rigid, person, choices, signals)] if rigid else []
    sprung = [one for one in met if one.kind == PENALTY]
    if not sprung:
        return found
    where = _where(sprung[0], person, choices)
    for episode in episodes(*course(sprung)):
        own = [one for one in sprung if one.end >= episode.whole.begin and one.begin <= episode.whole.end]
        exact = replace(episode, whole=replace(episode.whole, impulse=sum(one.impulse or 0.0 for one in own)))
        finding = assess(exact, where, choices.limits, signals)
        found.append(expected.beside(replace(finding, group=GROUP, regions=where.regions), exact, own, where))
    return [warned(finding) for finding in found]


def _rigid(met: Sequence[RegionForce], person: Person | None, choices: Choices, signals: Sequence[str]) -> Finding:
    """One for all touches of a pair, of which none has a force."""
    where = _where(met[0], person, choices)
    finding = assess(None, where, choices.limits, signals)
    window = min(one.begin for one in met), max(one.end for one in met)
    notes = (*finding.notes, f"they touched {len(met)} times")
    return replace(finding, group=GROUP, regions=where.regions, window=window, notes=notes)


def _where(one: RegionForce, person: Person | None, choices: Choices) -> Where:
    regions = () if person is None else person.body.regions.get(one.link, ())
    sides = {region.dominant for region in regions}
    dominant = sides.pop() if len(sides) == 1 else None
    return Where(one.regions, one.other, one.kind, None, dominant, choices.contact_area)


def course(met: Sequence[RegionForce]) -> tuple[FloatArray, FloatArray]:
    """(times [s], forces [N]) of all contacts of a pair, with their begins, peaks and ends, which may lie between two
    messages; between contacts the force is zero.

    A peak that rose between two messages is given to the later one.
    """
    touch = np.nextafter(episode_table()["touch_force"], np.inf)
    found: dict[float, float] = {}
    for one in met:
        rose = np.diff(one.course.reached, prepend=0.0) > 0.0
        forces = np.where(rose, np.maximum(one.course.force, one.course.reached), one.course.force)
        samples = [(one.begin, touch), (one.end, touch), *zip(one.course.time.tolist(), forces.tolist(), strict=True)]
        if one.peak is not None and one.peak_time is not None and not (one.course.reached >= one.peak).any():
            samples.append((one.peak_time, one.peak))
        for time, force in samples:
            found[time] = max(found.get(time, 0.0), force)
        found.setdefault(one.end + 1e-6, 0.0)
    time = np.array(sorted(found))
    return time, np.array([found[one] for one in time.tolist()])


@dataclass(frozen=True)
class Masses:
    """Of an arm: what moves behind its first joint, and what of it is the tool [kg]."""

    moving: float
    tool: float


class Expected:
    """What the closed form gives beside what was found.

    Args:
        given: the recording.
        choices: with the limits.
    """

    def __init__(self, given: Given, choices: Choices) -> None:
        self._choices, self._beside, self._why = choices, None, "what the closed form needs: a control log"
        log, human = given.recording.log, given.recording.human
        if log is None or human is None:
            return
        if not given.description or not given.definition.get("human"):
            self._why = "what the closed form needs: the robot's description and where the person was (run folder)"
            return
        try:
            self._beside = Beside(given.run, given.description, log, human)
        except HricError as error:
            self._why = f"what the closed form needs: {error}"
            return
        self.masses = masses(urdf.read(given.description), log.joint_names)
        self._load = float((given.definition.get("robot", {}).get("load") or {}).get("mass", 0.0))

    def beside(self, finding: Finding, episode: Episode, own: Sequence[RegionForce], where: Where) -> Finding:
        """The finding with it; own: the contacts of the episode."""
        if self._beside is None:
            return replace(finding, missing=(*finding.missing, self._why))
        forms = [form for one in own if (form := self._beside.transient(one)) is not None]
        if not forms:
            return finding
        form = max(forms, key=lambda form: form.peak)
        values, notes = self._of(form, where)
        values = {"speed at which they met [m/s]": form.speed, **values}
        return replace(finding, values={**finding.values, **values}, notes=(*finding.notes, *notes))

    def _of(self, form: Transient, where: Where) -> tuple[dict[str, float | None], list[str]]:
        values: dict[str, float | None] = {
            "reflected mass of the robot m_u [kg]": form.robot_mass,
            "reflected mass of the body as simulated [kg]": form.human_mass,
            "v sqrt(mu k) as simulated [N]": form.peak,
        }
        masses, limits = self.masses, self._choices.limits
        payload, moving = masses.tool + self._load, masses.moving - masses.tool
        area = where.contact_area
        both: list[tuple[str, BothMasses]] = []
        for region in where.regions:
            try:
                both.append((region, both_masses(limits, region, form.robot_mass, moving, payload, area)))
            except NotAssessableError as error:
                return values, [f"no permitted speed: {error}"]
        if not both:
            return values, []
        region, lowest = min(both, key=lambda pair: float(pair[1].reflected.transient))
        standard = 0.5 * moving + payload
        by_ours, by_half = float(lowest.reflected.transient), float(lowest.standard.transient)
        values["M/2 + m_L [kg]"] = standard
        values["permitted speed by m_u [m/s]"] = by_ours
        values["permitted speed by M/2 + m_L [m/s]"] = by_half
        if (limit := lowest.reflected.force_transient) is not None and region not in NOT_PERMITTED:
            values["speed at the limit, masses as simulated [m/s]"] = float(
                permitted_speed(limit, form.mass, form.stiffness)
            )
        side = "the unsafe side: it permits more than the mass that was met" if lowest.unsafe else "the safe side"
        return values, [
            f"closed form, {region}: the reflected mass m_u of {form.robot_mass:.2f} kg (with rotors, as simulated) "
            f"permits {by_ours:.3f} m/s, the standard's M/2 + m_L of {standard:.2f} kg {by_half:.3f} m/s, which is on "
            f"{side}"
        ]


def masses(tree: urdf.Robot, joints: Sequence[str]) -> Masses:
    """Of an arm; the tool is what hangs rigidly behind the link that the last of its joints moves."""
    behind: dict[str, list[str]] = {}
    for joint in tree.joints.values():
        behind.setdefault(joint.parent, []).append(joint.child)

    def mass(link: str) -> float:
        own = tree.links[link].mass
        return (0.0 if own is None else own.mass) + sum(mass(child) for child in behind.get(link, ()))

    first, last = tree.joints[joints[0]].child, tree.joints[joints[-1]].child
    return Masses(mass(first), sum(mass(child) for child in behind.get(last, ())))
