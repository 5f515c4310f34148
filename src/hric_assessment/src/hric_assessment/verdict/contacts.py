"""Findings about contacts: one for every contact episode of a person with other bodies.

Each episode is judged by the recorded force, and by its approach speed with the body model of ISO/TS 15066; the worse
of the two decides.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from hric_assessment.contact.area import check_area
from hric_assessment.contact.assess import ContactSite, LimitRatio, assess, held_ratio
from hric_assessment.contact.classes import BY_CLAMPING, INTERPRETATIONS, ContactClass, contact_class
from hric_assessment.contact.energy import energy_finding
from hric_assessment.contact.episodes import PENALTY, Episode, end_of, episodes, window_of
from hric_assessment.findings import CONTACT, ENERGY, Evidence, Finding, Outcome, finite_rows
from hric_assessment.tables import MASS, ROTORS, STIFFNESS, TIME_STEP, verdict_table
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.impacts import ExpectedImpacts
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import body_of
from hric_bags.records.human_record import GripRecord, HumanRecord
from hric_bags.records.region_contacts import ContactStream
from hric_core.errors import HricError
from hric_human.contact import RegionContact

TOPIC = "hric/human/contacts"
OTHER_REGION = "the region is not one of the link's"
ALL = "contacts"
"""Subject of findings about all contacts of a person."""
SILENT_GAP = 0.075
"""Longest gap between two contact messages of a simulated person that may be bridged [s].

It is 1.5 times the 50 ms after which an empty message is due (`hric_human.participant.topics.SILENCE`).
"""
HAND = "hand, fingers"
"""Region of a grip by a link whose regions are not known."""
BEYOND = "no source gives a limit for a grip above that of a quasi-static contact"
GRIP_REMEDY = "judge the grip by other means, or repeat the task with less force"
NOT_VARIED = (
    "the peak force is not that of an impact in closed form: how masses and stiffness would change it is not known"
)
SPEED_STEP = 1e-3
"""Time step assumed for a plant that does not state one [s]: 1 kHz, as in every run of this workspace."""


def contact_findings(source: AssessmentInput, choices: AssessmentChoices) -> list[Finding]:
    """Return the findings about all contacts of each person; if contacts are not recorded, one that states this.

    A finding about the energy of a contact follows that about its force.
    """
    humans = source.recording.humans
    findings = [finding for record in humans.values() for finding in _of_person(source, record, choices)]
    on_camera = (source.definition.get("mocap") or {}).get("human")
    for topic in source.recording.people:
        name = topic.rpartition("/")[0]
        if name not in humans and not (humans and on_camera):  # otherwise the tracked person is the simulated one
            findings.append(_not_recorded(source, choices, name))
    return findings or [_not_recorded(source, choices, "")]


def _not_recorded(source: AssessmentInput, choices: AssessmentChoices, name: str) -> Finding:
    """Return the finding that the contacts of a person are not recorded."""
    topic = f"{name}/contacts" if name.startswith("/") else TOPIC
    reason = f"contacts are not recorded: the topic {topic} is not in the recording"
    begin, end = source.recording.begin, source.recording.end
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
        group=CONTACT,
        evidence=evidence,
        remedy=remedy,
        person=name if name.startswith("/") else "",
    )


def _of_person(source: AssessmentInput, record: HumanRecord, choices: AssessmentChoices) -> list[Finding]:
    if record.stream is None:
        return [_not_recorded(source, choices, record.name)]
    judge = _Judge(source, record, choices)
    evidence, lost = _evidence(source, record, record.stream)
    remedy = f"record every message of {record.name}/contacts, with an empty one every 50 ms without contact"
    if not lost and (lost := source.untouchable):
        remedy = "run again with robot.plant.collision: true, and a collision shape for each link of the robot"
    regions: dict[tuple[tuple[str, ...], str], list[RegionContact]] = {}
    for contact in record.region_contacts:
        regions.setdefault(_region_key(contact), []).append(contact)
    findings = [finding for contacts in regions.values() for finding in judge.of_region(contacts)]
    findings += judge.of_grips()
    findings = [replace(finding, evidence=evidence) for finding in findings]
    if not findings or lost:
        rest = _rest(source, record, evidence, lost, remedy, choices)
        judged = any(finding.group == ENERGY for finding in findings)
        findings += [rest, replace(rest, subject=f"energy of {ALL}", group=ENERGY)] if lost and judged else [rest]
    return findings


def _evidence(source: AssessmentInput, record: HumanRecord, stream: ContactStream) -> tuple[Evidence, str]:
    """Return for how much of the recording the contacts are known, and a sentence if that is not all of it.

    If the source also sends empty messages, as the simulated person does, contacts are known wherever there are
    messages. If it sends only contacts, they are unknown between its messages if an arm is recorded, which may have
    touched the person; without an arm the source is assumed to report each contact while any data of the person is
    recorded.
    """
    window = source.recording.begin, source.recording.end
    times = [stream.time]
    if not reports_silence(source, stream):
        times = [stream.time, record.time] if record.region_contacts and source.recording.log is None else times
        times = times if record.region_contacts else []
    time = np.unique(np.concatenate([np.zeros(0), *times]))
    longest = verdict_table()["max_gap"]
    longest = min(longest, SILENT_GAP) if source.definition.get("human") else longest
    evidence = Evidence.of(time, np.isfinite(time), window, longest)
    if evidence.complete and not stream.lost:
        return evidence, ""
    if stream.lost:
        count = f"messages are missing in {len(stream.lost)} places, the first at {stream.lost[0][0]:.3f} s"
        return evidence, f"{count}: contacts at these times are not known"
    silent = ", and the source sends no empty messages while nothing touches the person"
    why = "" if reports_silence(source, stream) else silent
    return evidence, f"contacts of the person are not known for the whole time: {evidence.shortfall}{why}"


def reports_silence(source: AssessmentInput, stream: ContactStream) -> bool:
    """Return True if the source of contacts sends messages while nothing touches the person."""
    return stream.silent > 1 or bool(source.definition.get("human"))


def silence_assumed(source: AssessmentInput) -> list[str]:
    """Return an assumption for each person without messages between contacts, in a recording without an arm."""
    return [
        f"{record.name}/contacts has no messages without contact: its source is assumed to have run until the end"
        for record in source.recording.humans.values()
        if record.stream is not None and record.region_contacts and source.recording.log is None
        if not reports_silence(source, record.stream)
    ]


def _rest(
    source: AssessmentInput,
    record: HumanRecord,
    evidence: Evidence,
    lost: str,
    remedy: str,
    choices: AssessmentChoices,
) -> Finding:
    """Return the finding that nothing touched the person in the time without contacts, or that this is not known."""
    window, table = (source.recording.begin, source.recording.end), choices.limits.table.name
    signals = (f"{record.name}/contacts",)
    held = [grip.name for grip in record.grips.values() if grip.closed.any()]
    reason = f"nothing but the grips ({', '.join(held)}) touched the person" if held else "nothing touched the person"
    finding = Finding(ALL, Outcome.WITHIN, reason, table, 0.0, {}, window, signals, group=CONTACT, evidence=evidence)
    if lost:
        finding = replace(finding, outcome=Outcome.NOT_ASSESSABLE, share=None, reason=lost, remedy=remedy)
    return replace(finding, person=record.name)


def _region_key(contact: RegionContact) -> tuple[tuple[str, ...], str]:
    """Return regions (of a link without one, its name) and side of a contact; forces at one place are added."""
    return tuple(sorted(contact.regions)) or (contact.link,), contact.side


def _other(interpretation: str) -> str:
    return next(name for name in INTERPRETATIONS if name != interpretation)


class _Judge:
    """Assessment of the contacts of one person.

    Args:
        source: recording with the files next to it.
        record: recorded signals of the person.
        choices: choices with the limits.
    """

    def __init__(self, source: AssessmentInput, record: HumanRecord, choices: AssessmentChoices) -> None:
        self._source, self._record, self._choices = source, record, choices
        self._body = body_of(source, record)
        self._expected = ExpectedImpacts(source, record, choices)
        self._simulated = bool(source.definition.get("human"))
        self._window = source.recording.begin, source.recording.end
        self._period = float(source.plant.get("time_step", SPEED_STEP)) if self._simulated else np.inf

    @cached_property
    def _nominal(self) -> ExpectedImpacts:
        """Impacts without changed numbers, which are needed only where a changed number moves an impact."""
        return ExpectedImpacts(self._source, self._record, replace(self._choices, factors={}))

    def of_region(self, contacts: Sequence[RegionContact]) -> list[Finding]:
        """Return the findings of one region of the person, on one side of the body."""
        others: dict[str, list[RegionContact]] = {}
        for contact in contacts:
            if contact.kind != PENALTY:
                others.setdefault(contact.other, []).append(contact)
        findings = [self._without_force(touches) for touches in others.values()]
        sprung = [contact for contact in contacts if contact.kind == PENALTY]
        stream = self._record.stream
        until = float(stream.time[-1]) if stream is not None and len(stream.time) else 0.0
        for episode in episodes(sprung, self._period, until):
            findings += [finding.marked_near_limit() for finding in self._with_force(episode)]
        return findings

    def of_grips(self) -> list[Finding]:
        """Return a finding for each grip whose force is unknown or above the limit of a held contact."""
        stated, grips = (self._source.definition.get("human") or {}).get("grips") or {}, self._record.grips
        findings = [self._grip(f"grip {name}", "the grip is not recorded") for name in stated if name not in grips]
        return findings + [finding for grip in grips.values() if (finding := self._of_grip(grip)) is not None]

    def _of_grip(self, grip: GripRecord) -> Finding | None:
        of_link, links = {} if self._body is None else self._body.regions, (grip.holder, grip.held)
        found = [region.name for body in links for region in of_link.get(body.rpartition("::")[2], ())]
        limit, force = self._choices.limits.at(found or [HAND]), np.linalg.norm(grip.force[grip.closed], axis=1)
        silent = self._simulated or not grip.closed.all()  # the source also sends messages while the grip is open
        window = self._window if silent else (float(grip.time[0]), float(grip.time[-1]))
        known = finite_rows(grip.force) | ~grip.closed
        evidence = Evidence.of(grip.time, known, window, verdict_table()["max_gap"])
        reason = f"the force of the grip is {evidence.shortfall}" if not evidence.complete else ""
        if len(force) and limit is None:
            reason = f"{self._choices.limits.table.title} has no limit for {' or '.join(found)}"
        elif limit is not None:
            largest = held_ratio(float(np.append(force, grip.left_out[0]).max()), limit)
            if not largest.ratio <= 1.0:
                high = math.isfinite(largest.ratio)
                reason = f"{largest}; {BEYOND}" if high else "the force of the grip is not known"
        if not reason:
            return None
        closed = grip.time[grip.closed]
        window = (float(closed[0]), float(closed[-1])) if len(closed) else window
        return replace(
            self._grip(f"grip {grip.name} of {grip.held} by {grip.holder}", reason), window=window, regions=tuple(found)
        )

    def _grip(self, subject: str, reason: str) -> Finding:
        return Finding(
            subject,
            Outcome.NOT_ASSESSABLE,
            reason,
            self._choices.limits.table.name,
            window=self._window,
            signals=(f"{self._record.name}/grip",),
            group=CONTACT,
            person=self._record.name,
            remedy=GRIP_REMEDY if BEYOND in reason else f"record every message of {self._record.name}/grip",
        )

    def _without_force(self, contacts: Sequence[RegionContact]) -> Finding:
        """Return one finding for all contacts of two bodies that have no meaningful force."""
        finding = self._assessed(None, self._site(contacts)[0], contacts, None)
        return replace(finding, notes=(*finding.notes, f"number of contacts: {len(contacts)}"))

    def _with_force(self, episode: Episode) -> list[Finding]:
        """Return the findings about force and energy of an episode; the latter may be missing."""
        site, notes = self._site(episode.contacts)
        try:
            approach, impact, doubts = self._expected.approach(episode.contacts, site, self._simulated)
        except HricError:  # a region that does not exist becomes the reason of the finding in _assessed
            approach, impact, doubts = None, None, []
        refused = [note for note in notes if note.startswith(("the recorded contact area", OTHER_REGION))]
        doubts = [*episode.doubts, *doubts, *refused, *self._beside(episode.contacts)]
        episode = self._varied(replace(episode, doubts=tuple(doubts)))
        kind, why = contact_class(episode.contacts, self._record.region_contacts, self._simulated)
        chosen = self._choices.interpretation
        held = chosen == BY_CLAMPING and kind != ContactClass.FREE
        finding = self._assessed(episode, site, episode.contacts, approach, held=held)
        classed = [f"class: {kind} ({why}); interpretation of the limits: {chosen}"]
        if kind != ContactClass.FREE:
            other = self._assessed(episode, site, episode.contacts, approach, held=not held)
            if other.outcome != finding.outcome:
                classed.append(f"interpretation {_other(chosen)}: {other.outcome}: {other.reason}")
        values, more, missing = self._expected.values(impact, site)
        if finding.outcome == Outcome.NOT_ASSESSABLE and episode.doubts:
            topic = f"{self._record.name}/contacts"
            remedy = f"record every message of {topic} until the bodies separate, with forces sampled at 1000 Hz"
            finding = replace(finding, remedy=remedy)
        finding = replace(
            finding,
            values={**finding.values, **values},
            notes=(*classed, *finding.notes, *notes, *more),
            missing=(*finding.missing, *missing),
        )
        try:
            energy = energy_finding(episode, site, self._choices.limits, held=held)
        except HricError:  # the reason of the finding about the force
            energy = None
        about = {name: getattr(finding, name) for name in ("signals", "regions", "side", "window", "person")}
        return [finding] if energy is None else [finding, replace(energy, notes=(*classed, *energy.notes), **about)]

    def _beside(self, contacts: Sequence[RegionContact]) -> list[str]:
        """Return the doubt that contacts at another place may press on the same region at the same time."""
        (begin, end), first = window_of(contacts), contacts[0]
        others = [
            f"the contact of {touch.other} with {touch.link}"
            for touch in self._record.region_contacts
            if touch.kind == PENALTY and touch.begin <= end and begin <= end_of(touch)
            if set(touch.regions) & set(first.regions) and _region_key(touch) != _region_key(first)
            if (touch.side == first.side or not touch.side or not first.side)
        ]
        return [f"{' and '.join(dict.fromkeys(others))} may press on the same region at the same time"] * bool(others)

    def _varied(self, episode: Episode) -> Episode:
        """Return a simulated episode whose impact has the force and energy of the closed form with the factors."""
        factors, peak, held = self._choices.factors, episode.transient, episode.quasi_static
        if not factors or not self._simulated or not episode.known:
            return episode
        ratio, contact = factors.get(TIME_STEP, 1.0), max(episode.contacts, key=lambda contact: contact.peak or 0.0)
        work = ratio * ratio
        if factors.keys() & {MASS, ROTORS, STIFFNESS}:
            before, after = self._nominal.form(contact), self._expected.form(contact)
            if before is None or after is None or peak.peak_time > contact.begin + before.duration:
                return replace(episode, notes=(*episode.notes, NOT_VARIED))
            ratio *= after.peak / before.peak
            work *= after.mass / before.mass
        largest = max(ratio * peak.peak, 0.0 if held is None else held.peak)
        overall = replace(episode.overall, peak=largest)
        contacts = tuple(
            item if item.energy is None else replace(item, energy=work * item.energy) for item in episode.contacts
        )
        return replace(episode, transient=replace(peak, peak=ratio * peak.peak), overall=overall, contacts=contacts)

    def _assessed(
        self,
        episode: Episode | None,
        site: ContactSite,
        contacts: Sequence[RegionContact],
        approach: LimitRatio | None,
        *,
        held: bool = False,
    ) -> Finding:
        signals, limits = (f"{self._record.name}/contacts",), self._choices.limits
        try:
            finding = assess(episode, site, limits, signals, approach, held=held)
        except HricError as error:  # an unknown region affects only this contact
            finding = Finding(site.subject, Outcome.NOT_ASSESSABLE, str(error), limits.table.name, signals=signals)
        window, person, side = window_of(contacts), self._record.name, contacts[0].side
        return replace(finding, group=CONTACT, regions=site.regions, side=side, window=window, person=person)

    def _site(self, contacts: Sequence[RegionContact]) -> tuple[ContactSite, list[str]]:
        """Return the place of a contact, and notes about contradictions between recording, body and user."""
        first, notes, areas = contacts[0], list[str](), dict[str, float]()
        names = tuple(dict.fromkeys(name for contact in contacts for name in contact.regions))
        recorded = min((contact.area for contact in contacts if contact.area is not None), default=None)
        for source, value in (("recorded", recorded), ("stated", self._choices.contact_area)):
            if value is not None:
                try:
                    check_area(value, names, f"the {source} contact area")
                    areas[source] = value
                except HricError as error:
                    notes.append(str(error))
        if "recorded" in areas and "stated" not in areas and any(contact.area is None for contact in contacts):
            notes.append("the recorded contact area is that of some of the contacts only")
        area = min(areas.values(), default=None)
        if len(areas) > 1:
            both = f"{areas['recorded']:g} m^2 recorded, {areas['stated']:g} m^2 stated"
            notes.append(f"contact area: {both}; the smaller counts")
        regions = () if self._body is None else self._body.regions.get(first.link, ())
        sides = {region.dominant for region in regions}
        of_link = {region.name for region in regions}
        if of_link and names and not of_link & set(names):
            notes.append(f"{OTHER_REGION}: {first.link} belongs to {' or '.join(sorted(of_link))}")
        dominant = sides.pop() if len(sides) == 1 else None
        if dominant is not None and any(contact.dominant is not dominant for contact in contacts):
            notes.append("body and message disagree about the side of the dominant hand: the lower limit counts")
            dominant = None
        others = " and ".join(dict.fromkeys(contact.other for contact in contacts))
        return ContactSite(names, others, first.kind, None, dominant, area), notes
