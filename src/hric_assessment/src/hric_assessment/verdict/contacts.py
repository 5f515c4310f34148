"""Findings of contacts: every contact episode of a person with other bodies.

Each is judged by the force of the simulated body and by the standard's body model; the worse of the two decides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hric_assessment.contact import course
from hric_assessment.contact.area import check_area
from hric_assessment.contact.assess import Approach, Unknown, Where, assess
from hric_assessment.contact.course import Meeting
from hric_assessment.contact.episodes import PENALTY
from hric_assessment.contact.impact import Beside, Transient
from hric_assessment.contact.limits import NOT_PERMITTED
from hric_assessment.contact.speed import BothMasses, SpeedLimit, both_masses, permitted_speed, speed_limit
from hric_assessment.evidence import Evidence
from hric_assessment.findings import Finding, NotAssessableError, Outcome
from hric_assessment.tables import verdict_table
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.person import body_of
from hric_assessment.verdict.result import warned
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.region_contacts import ContactStream, RegionForce
from hric_core import urdf
from hric_core.errors import HricError

GROUP = "contact"
TOPIC = "hric/human/contacts"
OTHER_REGION = "the region is not one of the link's"
ALL = "contacts"
"""Subject of a finding about all contacts of a person."""
UNBOUNDED = 1e12
"""Mass of a robot with unknown mass [kg]: large enough to be the worst case."""
SILENT_GAP = 0.075
"""Longest time between two messages of a simulated person's contacts [s].

1.5 times the 50 ms after which an empty message is due (`hric_human.participant.topics.SILENCE`).
"""
SPEED_STEP = 1e-3
"""Default time step of a plant that does not state one [s]: 1 kHz, as in every run of this workspace."""


def contact_findings(given: Given, choices: Choices) -> list[Finding]:
    """Return the findings of all contacts of each person; one finding says so if contacts are not recorded."""
    humans = given.recording.humans
    findings = [finding for record in humans.values() for finding in _of_person(given, record, choices)]
    on_camera = (given.definition.get("mocap") or {}).get("human")
    for topic in given.recording.people:
        if not (humans and on_camera):  # otherwise it is the same simulated person
            findings.append(_not_recorded(given, choices, topic.rpartition("/")[0]))
    return findings or [_not_recorded(given, choices, "")]


def _not_recorded(given: Given, choices: Choices, name: str) -> Finding:
    """Return the finding that the contacts of a person are not recorded."""
    topic = f"{name}/contacts" if name.startswith("/") else TOPIC
    reason = f"contacts are not recorded: the topic {topic} is not in the recording"
    begin, end = given.recording.begin, given.recording.end
    evidence = Evidence(end - begin, 0.0, 0.0, end - begin, 0, verdict_table()["max_gap"])
    remedy = f"record {topic}, of a person in the robot's plant or of a force sensor"
    table = choices.limits.table.name
    return Finding(
        ALL,
        Outcome.NOT_ASSESSABLE,
        reason,
        table,
        window=(begin, end),
        missing=(topic,),
        group=GROUP,
        evidence=evidence,
        remedy=remedy,
        person=name if name.startswith("/") else "",
    )


def _of_person(given: Given, record: HumanRecord, choices: Choices) -> list[Finding]:
    if record.stream is None:
        return [_not_recorded(given, choices, record.name)]
    judge = _Judge(given, record, choices)
    evidence, lost = _evidence(given, record, record.stream)
    regions: dict[tuple[tuple[str, ...], str], list[RegionForce]] = {}
    for contact in record.meetings:
        side = contact.link[:2] if contact.link.startswith(("r_", "l_")) else ""
        regions.setdefault((tuple(sorted(contact.regions)) or (contact.link,), side), []).append(contact)
    findings = [finding for contacts in regions.values() for finding in judge.of_region(contacts)]
    findings = [replace(finding, evidence=evidence) for finding in findings]
    if not findings or lost:
        findings.append(_rest(given, record, evidence, lost, bool(findings), choices))
    return findings


def _evidence(given: Given, record: HumanRecord, stream: ContactStream) -> tuple[Evidence, str]:
    """Return how much of the recording the contacts are known for, and a sentence if they are not completely known.

    A source that also sends empty messages, as the simulated person does, is known wherever it has messages. A source
    that sends only contacts is unknown between its messages if an arm is recorded, which may have touched the person;
    without an arm it is assumed to report each contact while any data of the person is recorded.
    """
    window = given.recording.begin, given.recording.end
    times = [stream.time]
    if not reports_silence(given, stream):
        times = [stream.time, record.time] if record.meetings and given.recording.log is None else times
        times = times if record.meetings else []
    time = np.unique(np.concatenate([np.zeros(0), *times]))
    longest = verdict_table()["max_gap"]
    longest = min(longest, SILENT_GAP) if given.definition.get("human") else longest
    evidence = Evidence.of(time, np.isfinite(time), window, longest)
    if evidence.complete and not stream.lost:
        return evidence, ""
    if stream.lost:
        count = f"messages are missing in {len(stream.lost)} places, the first at {stream.lost[0][0]:.3f} s"
        return evidence, f"{count}: what touched the person then is not known"
    why = "" if reports_silence(given, stream) else ", and its source sends no empty message while nothing touches"
    return evidence, f"what touched the person is not known for all of the time: {evidence.shortfall}{why}"


def reports_silence(given: Given, stream: ContactStream) -> bool:
    """Return True if the source of contacts sends messages while nothing touches the person."""
    return stream.silent > 1 or bool(given.definition.get("human"))


def silence_assumed(given: Given) -> list[str]:
    """Return an assumption for each person without messages between contacts, in a recording without an arm."""
    return [
        f"{record.name}/contacts has no message while nothing touches: its source is taken to have run until the end"
        for record in given.recording.humans.values()
        if record.stream is not None and record.meetings and given.recording.log is None
        if not reports_silence(given, record.stream)
    ]


def _rest(given: Given, record: HumanRecord, evidence: Evidence, lost: str, touched: bool, choices: Choices) -> Finding:
    """Return the finding about the time without recorded contacts."""
    window, table = (given.recording.begin, given.recording.end), choices.limits.table.name
    signals = (f"{record.name}/contacts",)
    held = [grip.name for grip in record.grips.values() if grip.closed.any()]
    reason = f"nothing but the grips ({', '.join(held)}) touched the person" if held else "nothing touched the person"
    finding = Finding(ALL, Outcome.WITHIN, reason, table, 0.0, {}, window, signals, group=GROUP, evidence=evidence)
    if lost:
        remedy = f"record every message of {record.name}/contacts, with an empty one each 50 ms while nothing touches"
        outcome = Outcome.NOT_ASSESSABLE
        finding = replace(finding, outcome=outcome, share=None, reason=lost, remedy=remedy)
    return replace(finding, person=record.name)


class _Judge:
    """Assessment of the contacts of one person.

    Args:
        given: the recording.
        record: recording of the person.
        choices: choices with the limits.
    """

    def __init__(self, given: Given, record: HumanRecord, choices: Choices) -> None:
        self._record, self._choices = record, choices
        self._body = body_of(given, record)
        self._expected = Expected(given, record, choices)
        self._simulated = bool(given.definition.get("human"))
        self._period = float(given.plant.get("time_step", SPEED_STEP)) if self._simulated else np.inf

    def of_region(self, contacts: Sequence[RegionForce]) -> list[Finding]:
        """Return the findings of one region of the person, on one side of the body."""
        others: dict[str, list[RegionForce]] = {}
        for contact in contacts:
            if contact.kind != PENALTY:
                others.setdefault(contact.other, []).append(contact)
        findings = [self._without_force(own) for own in others.values()]
        sprung = [contact for contact in contacts if contact.kind == PENALTY]
        stream = self._record.stream
        until = float(stream.time[-1]) if stream is not None and len(stream.time) else 0.0
        for meeting in course.meetings(sprung, self._period, until):
            findings.append(warned(self._with_force(meeting)))
        return findings

    def _without_force(self, contacts: Sequence[RegionForce]) -> Finding:
        """Return one finding for all touches of a pair without a meaningful force."""
        where, _ = self._where(contacts)
        window = min(one.begin for one in contacts), max(course.end_of(one) for one in contacts)
        finding = self._assessed(None, where, window, Unknown(), None)
        return replace(finding, notes=(*finding.notes, f"they touched {len(contacts)} times"))

    def _with_force(self, meeting: Meeting) -> Finding:
        where, notes = self._where(meeting.contacts)
        try:
            approach, form, doubts = self._expected.approach(meeting, where, self._simulated)
        except HricError:  # _assessed names a region that does not exist
            approach, form, doubts = None, None, []
        refused = [note for note in notes if note.startswith(("the recorded contact area", OTHER_REGION))]
        unknown = Unknown((*meeting.doubts, *doubts, *refused), meeting.unknown_peak)
        finding = self._assessed(meeting, where, meeting.window, unknown, approach)
        values, more, missing = self._expected.beside(form, where)
        remedy = finding.remedy
        if finding.outcome == Outcome.NOT_ASSESSABLE and unknown.doubts:
            topic = f"{self._record.name}/contacts"
            remedy = f"record every message of {topic} until the bodies part, of forces evaluated 1000 times a second"
        return replace(
            finding,
            remedy=remedy,
            values={**finding.values, **values},
            notes=(*finding.notes, *notes, *more),
            missing=(*finding.missing, *missing),
        )

    def _assessed(
        self,
        meeting: Meeting | None,
        where: Where,
        window: tuple[float, float],
        unknown: Unknown,
        approach: Approach | None,
    ) -> Finding:
        signals = (f"{self._record.name}/contacts",)
        try:
            episode = None if meeting is None else meeting.episode
            finding = assess(episode, where, self._choices.limits, signals, unknown, approach)
        except HricError as error:  # an unknown region affects only this contact
            table = self._choices.limits.table.name
            finding = Finding(where.subject, Outcome.NOT_ASSESSABLE, str(error), table, signals=signals)
        name = self._record.name
        return replace(finding, group=GROUP, regions=where.regions, window=window, person=name)

    def _where(self, contacts: Sequence[RegionForce]) -> tuple[Where, list[str]]:
        """Return the contact's location, and notes on the statements of the recording and the user about it."""
        first, notes, areas = contacts[0], list[str](), dict[str, float]()
        names = tuple(dict.fromkeys(name for one in contacts for name in one.regions))
        recorded = min((one.area for one in contacts if one.area is not None), default=None)
        for source, value in (("recorded", recorded), ("stated", self._choices.contact_area)):
            if value is not None:
                try:
                    check_area(value, names, f"the {source} contact area")
                    areas[source] = value
                except HricError as error:
                    notes.append(str(error))
        area = min(areas.values(), default=None)
        if len(areas) > 1:
            both = f"{areas['recorded']:g} m^2 recorded, {areas['stated']:g} m^2 stated"
            notes.append(f"contact area: {both}; the smaller counts")
        regions = () if self._body is None else self._body.regions.get(first.link, ())
        sides = {region.dominant for region in regions}
        own = {region.name for region in regions}
        if own and names and not own & set(names):
            notes.append(f"{OTHER_REGION}: {first.link} belongs to {' or '.join(sorted(own))}")
        dominant = sides.pop() if len(sides) == 1 else None
        if dominant is not None and any(one.dominant is not dominant for one in contacts):
            notes.append("the body and the message differ on the side of the dominant hand: the lower limit counts")
            dominant = None
        others = " and ".join(dict.fromkeys(one.other for one in contacts))
        return Where(names, others, first.kind, None, dominant, area), notes


@dataclass(frozen=True)
class Masses:
    """Masses of an arm.

    Attributes:
        moving: mass behind the first joint [kg].
        tool: mass of the tool, part of `moving` [kg].
    """

    moving: float
    tool: float


class Expected:
    """Closed form of two masses and a spring, for comparison with the recorded contacts.

    Args:
        given: the recording.
        record: recording of the person.
        choices: choices with the limits.
    """

    def __init__(self, given: Given, record: HumanRecord, choices: Choices) -> None:
        self._choices, self._beside, self._why = choices, None, "what the closed form needs: a control log"
        log = given.recording.log
        if log is None or not len(record.time):
            return
        if not given.description or not given.definition.get("human"):
            self._why = "what the closed form needs: the robot's description and where the person was (run folder)"
            return
        try:
            self._beside = Beside(given.run, given.description, log, record)
        except HricError as error:
            self._why = f"what the closed form needs: {error}"
            return
        self.masses = masses(urdf.read(given.description), log.joint_names)
        self._load = float((given.definition.get("robot", {}).get("load") or {}).get("mass", 0.0))

    def approach(
        self, meeting: Meeting, where: Where, simulated: bool
    ) -> tuple[Approach | None, Transient | None, list[str]]:
        """Return the worst approach of the contacts, its closed form, and doubts.

        Args:
            meeting: the contacts.
            where: the two bodies.
            simulated: True if the recording is of a plant, which states each approach speed.
        """
        unknown = [one for one in meeting.contacts if one.speed is None or not np.isfinite(one.speed)]
        placed = any(one.point is not None for one in unknown)
        doubts = ["the speed at which they met is not known"] if unknown and (simulated or placed) else []
        found = []
        for contact in meeting.contacts:
            speed = 0.0 if contact.speed is None else abs(contact.speed)  # also for a touch while the bodies separate
            if not speed > 0.0:
                continue
            form = None if self._beside is None else self._beside.transient(contact)
            if form is not None and not np.isfinite(form.peak):
                form = None  # the arm's motion is not known at that time
            if (limit := self._lowest(form, where)) is not None:
                label = f"{limit.region}, {'robot of unknown mass' if form is None else 'heavier of both masses'}"
                found.append((Approach(speed, float(limit.transient), label, form is not None), form))
        worst = max(found, key=lambda pair: pair[0].speed / max(pair[0].permitted, 1e-9), default=(None, None))
        return worst[0], worst[1], doubts

    def _lowest(self, form: Transient | None, where: Where) -> SpeedLimit | None:
        """Return the lowest permitted speed of the regions and of the robot's masses; None: no region has one."""
        found = []
        for region in where.regions:
            if region in NOT_PERMITTED:
                continue
            mass = UNBOUNDED if form is None else max(form.robot_mass, self._standard_mass)
            try:
                found.append(speed_limit(self._choices.limits, region, mass, where.contact_area, where.dominant))
            except NotAssessableError:
                return None
        return min(found, key=lambda one: float(one.transient), default=None)

    @property
    def _standard_mass(self) -> float:
        return 0.5 * (self.masses.moving - self.masses.tool) + self.masses.tool + self._load

    def beside(
        self, form: Transient | None, where: Where
    ) -> tuple[Mapping[str, float | None], tuple[str, ...], tuple[str, ...]]:
        """Return values, notes and missing data of the closed form."""
        if self._beside is None:
            return {}, (), (self._why,)
        if form is None:
            return {}, (), ()
        values: dict[str, float | None] = {
            "speed at which they met [m/s]": form.speed,
            "reflected mass of the robot m_u [kg]": form.robot_mass,
            "reflected mass of the body as simulated [kg]": form.human_mass,
            "v sqrt(mu k) as simulated [N]": form.peak,
        }
        moving, payload = self.masses.moving - self.masses.tool, self.masses.tool + self._load
        both: list[tuple[str, BothMasses]] = []
        for region in where.regions:
            try:
                area = where.contact_area
                speeds = both_masses(self._choices.limits, region, form.robot_mass, moving, payload, area)
                both.append((region, speeds))
            except NotAssessableError as error:
                return values, (f"no permitted speed: {error}",), ()
        if not both:
            return values, (), ()
        return self._permitted(values, form, *min(both, key=lambda pair: float(pair[1].reflected.transient)))

    def _permitted(
        self, values: dict[str, float | None], form: Transient, region: str, lowest: BothMasses
    ) -> tuple[Mapping[str, float | None], tuple[str, ...], tuple[str, ...]]:
        standard, by_ours, by_half = self._standard_mass, lowest.reflected.transient, lowest.standard.transient
        values["M/2 + m_L [kg]"] = standard
        values["permitted speed by m_u [m/s]"] = float(by_ours)
        values["permitted speed by M/2 + m_L [m/s]"] = float(by_half)
        if (limit := lowest.reflected.force_transient) is not None and region not in NOT_PERMITTED:
            speed = permitted_speed(limit, form.mass, form.stiffness)
            values["speed at the limit, masses as simulated [m/s]"] = float(speed)
        side = "the unsafe side: it permits more than the mass that was met" if lowest.unsafe else "the safe side"
        note = (
            f"closed form, {region}: the reflected mass m_u of {form.robot_mass:.2f} kg (with rotors, as simulated) "
            f"permits {by_ours:.3f} m/s, the standard's M/2 + m_L of {standard:.2f} kg {by_half:.3f} m/s, which is on "
            f"{side}"
        )
        return values, (note,), ()


def masses(tree: urdf.Robot, joints: Sequence[str]) -> Masses:
    """Return the masses of an arm; the tool is everything fixed to the link behind the last joint."""
    behind: dict[str, list[str]] = {}
    for joint in tree.joints.values():
        behind.setdefault(joint.parent, []).append(joint.child)

    def mass(link: str) -> float:
        own = tree.links[link].mass
        return (0.0 if own is None else own.mass) + sum(mass(child) for child in behind.get(link, ()))

    first, last = tree.joints[joints[0]].child, tree.joints[joints[-1]].child
    return Masses(mass(first), sum(mass(child) for child in behind.get(last, ())))
