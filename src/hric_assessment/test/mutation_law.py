"""The law: no mutation of a recording may improve an outcome, and what it touched is named.

    assert not tally(recorded).faults

Outcomes from the worst on: above limits, not assessable, warning, within limits. They are compared for the whole
verdict and for each group of findings; a group without findings is one of which nothing is known, so not assessable.
The law:

1. Nothing becomes better, with one exception: what was above limits may become not assessable where the messages that
   show it are not in the bag any more.
2. They still are, and above stays above, where every message of the finding's signals within its window, and a tenth of
   a second around it, is in the damaged bag as it was. Of a contact two messages are enough: the last one that has its
   peak, and the one with the largest force after the transient time.
3. An outcome that changes is explained: a sentence that was not there before names the topic. So it is where a topic is
   not in the bag any more from which a finding came, and where there is somebody else.
4. A recording of which nothing can be said is refused by an HricError; any other exception is a fault.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bag_mutations import CONTACTS, Mutation, RawBag, Window, mutations

from hric_assessment.findings import Finding, Outcome
from hric_assessment.tables import episode_table
from hric_assessment.verdict.assess import judge
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.result import Verdict
from hric_bags.records import recording
from hric_core.errors import HricError

ORDER = (Outcome.ABOVE, Outcome.NOT_ASSESSABLE, Outcome.WARNING, Outcome.WITHIN)
"""Outcomes from the worst to the best."""
AROUND = 0.1
"""Time around a finding's window in which its messages must be undamaged [s]."""
WORDS = {
    "contacts": ("contact",),
    "joint_states": ("joint", "angle", "posture"),
    "joint_torque": ("torque",),
    "root": ("root", "person's position", "person", "human_base"),
    "grip": ("grip", "hand", "load"),
    "control_log": ("arm", "robot"),
    "robot_description": ("description",),
    "tf_static": ("transform", "person's position"),
    "tracking": ("track", "root"),
    "activation": ("activation", "muscle"),
    "events": ("event",),
}
"""Words by which a sentence names a topic, by the last part of its name; of another one: that part."""

SIDES = ("left", "right", "[lr]_")
"""Words by which a sentence names a side."""
SEVERAL = ("human2", "person2", "two ", "several", "second", "publisher")
"""Words by which a sentence says that there is somebody else."""
ALSO = {"separation": ("/robot_description", "/tf_static"), "posture": ("/tf_static",)}
"""Topics that findings of a group need beside their signals."""


@dataclass(frozen=True)
class Recorded:
    """A recording and what is written beside it.

    Attributes:
        name: of the recording.
        bag: its messages.
        run: contents of run.yaml; empty: a bag alone.
        description: URDF of the robot; "": that of the bag.
        choices: of the verdict.
    """

    name: str
    bag: RawBag
    run: Mapping[str, Any] = field(default_factory=dict)
    description: str = ""
    choices: AssessmentChoices = field(default_factory=AssessmentChoices)

    def with_bag(self, bag: RawBag) -> "Recorded":
        """Return the same with other messages."""
        return replace(self, bag=bag)


@dataclass(frozen=True)
class Judged:
    """Result of assessing a recording: verdict, refusal or crash.

    Attributes:
        recorded: the recording.
        verdict: None: it was refused.
        refusal: text of the refusal.
        crash: exception that is no HricError; empty: none.
        offset: time of the bag at robot time zero [s].
    """

    recorded: Recorded
    verdict: Verdict | None
    refusal: str = ""
    crash: str = ""
    offset: float = 0.0

    @property
    def outcomes(self) -> dict[str, Outcome]:
        """Outcomes of the verdict (key "all") and of each group of findings."""
        if self.verdict is None:
            return {}
        groups: dict[str, Outcome] = {"all": self.verdict.outcome}
        for finding in self.verdict.findings:
            groups[finding.group] = min(groups.get(finding.group, Outcome.WITHIN), finding.outcome, key=ORDER.index)
        return groups

    @property
    def sentences(self) -> set[str]:
        """All sentences of the verdict, or the text of the refusal."""
        if self.verdict is None:
            return {self.refusal}
        said = [*map(str, self.verdict.missing), *self.verdict.assumptions]
        for one in self.verdict.findings:
            shortfall = "" if one.evidence is None else one.evidence.shortfall
            evidence = f"{' '.join(one.signals)}: {shortfall}" if shortfall else ""
            said += [str(one), one.remedy, evidence, *one.missing, *one.notes]
        return {sentence for sentence in said if sentence}

    def window(self, finding: Finding) -> Window | None:
        """Time of a finding, as the bag has it [s]."""
        if finding.window is None:
            return None
        return finding.window[0] + self.offset, finding.window[1] + self.offset

    @property
    def windows(self) -> dict[str, Window]:
        """Time of the worst finding of each group that is no longer than half of the bag [s]."""
        if self.verdict is None:
            return {}
        found: dict[str, Window] = {}
        for finding in self.verdict.findings:
            window = self.window(finding)
            if window is not None and window[1] - window[0] < 0.5e-9 * self.recorded.bag.duration:
                found.setdefault(finding.group, window)
        return found


def judged(recorded: Recorded) -> Judged:
    """Assess a recording from memory."""
    try:
        taken = recording.read(recorded.bag)
        offset = taken.begin - taken.robot_time(taken.begin)
        description = recorded.description or taken.description
        kind = "run" if recorded.run else "bag"
        given = AssessmentInput(recorded.name, kind, Path(), taken, recorded.run, description)
        return Judged(recorded, judge(given, recorded.choices), offset=offset)
    except HricError as error:
        return Judged(recorded, None, str(error))
    except Exception as error:
        return Judged(recorded, None, crash=f"{type(error).__name__}: {error}")


@dataclass
class Tally:
    """Number of mutations by their effect on the verdict.

    Attributes:
        named: in a sentence that was not there before.
        unchanged: nothing was said, and the outcomes are those of the undamaged recording.
        refused: of these recordings nothing is said but why.
        faults: sentences about where the law is broken.
    """

    named: int = 0
    unchanged: int = 0
    refused: int = 0
    faults: list[str] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of all mutations."""
        return self.named + self.unchanged + self.refused + len(self.faults)

    def __str__(self) -> str:
        return (
            f"{self.count} mutations: {self.named} named, {self.refused} refused, {self.unchanged} without effect, "
            f"{len(self.faults)} faults"
        )

    def add(self, base: Judged, mutation: Mutation) -> None:
        """Apply a mutation and count what it leads to."""
        recorded = base.recorded
        damaged = judged(recorded.with_bag(mutation.apply(recorded.bag)))
        if found := faults_of(base, damaged, mutation):
            self.faults.append(f"{recorded.name}: {mutation}: {'; '.join(found)}")
        elif damaged.verdict is None:
            self.refused += 1
        elif named(base, damaged, mutation):
            self.named += 1
        else:
            self.unchanged += 1

    def add_all(self, other: "Tally") -> None:
        """Add the counts of another one."""
        self.named += other.named
        self.unchanged += other.unchanged
        self.refused += other.refused
        self.faults += other.faults


def tally(recorded: Recorded, seed: int = 0) -> Tally:
    """Damage a recording in all ways; seed: as of `mutations`.

    Raises:
        AssertionError: nothing can be said of the recording itself.
    """
    base, found = judged(recorded), Tally()
    assert base.verdict is not None, f"{recorded.name}: {base.refusal}{base.crash}"
    for mutation in mutations(recorded.bag, base.windows, seed):
        found.add(base, mutation)
    return found


def faults_of(base: Judged, damaged: Judged, mutation: Mutation) -> list[str]:
    """Return where the law is broken, one sentence each."""
    if damaged.crash:
        return [f"a traceback: {damaged.crash}"]
    if damaged.verdict is None:
        return [] if _named(mutation, {damaged.refusal}) else [f"refused without a word of it: {damaged.refusal}"]
    faults, before, found = list[str](), base.outcomes, damaged.outcomes
    after = {group: found.get(group, Outcome.NOT_ASSESSABLE) for group in before}
    for group, outcome in before.items():
        now = after[group]
        if ORDER.index(now) <= ORDER.index(outcome):
            continue
        if outcome is not Outcome.ABOVE or now is not Outcome.NOT_ASSESSABLE:
            faults.append(f"{group}: {outcome} became {now}")
        elif shown := [one for one in _above(base, group) if still_shown(base, damaged.recorded.bag, one)]:
            faults.append(f"{group}: {outcome} became {now}, though the bag still shows it: {shown[0]}")
    if not faults and (before != after or _must_be_named(base, mutation)) and not named(base, damaged, mutation):
        faults.append(f"nothing is said of {', '.join(mutation.topics)}: {_text(before)}, then {_text(after)}")
    return faults


def _text(outcomes: Mapping[str, Outcome]) -> str:
    return ", ".join(f"{group} {outcome}" for group, outcome in outcomes.items())


def _above(base: Judged, group: str) -> list[Finding]:
    assert base.verdict is not None
    return [one for one in base.verdict.findings if one.outcome is Outcome.ABOVE and group in ("all", one.group)]


def _must_be_named(base: Judged, mutation: Mutation) -> bool:
    if mutation.kind in ("second person", "two publishers"):
        return True
    assert base.verdict is not None
    return mutation.kind == "strip" and any(mutation.topics[0] in one.signals for one in base.verdict.findings)


def named(base: Judged, damaged: Judged, mutation: Mutation) -> bool:
    """True if a sentence that was not there before names what was touched."""
    return _named(mutation, damaged.sentences - base.sentences)


def _named(mutation: Mutation, sentences: Iterable[str]) -> bool:
    words = [word for topic in mutation.topics for word in _words(topic)]
    if mutation.kind == "swap":
        words += SIDES
    if mutation.kind in ("second person", "two publishers"):
        words = list(SEVERAL)
    return any(re.search(rf"\b{word}", sentence) for sentence in sentences for word in words)


def _words(topic: str) -> Sequence[str]:
    last = topic.rpartition("/")[2]
    return (*WORDS.get(last, ()), last, topic.lstrip("/"))


def still_shown(base: Judged, damaged: RawBag, finding: Finding) -> bool:
    """True if the messages that show a finding are in a damaged bag as they were (2. of the law)."""
    window, bag = base.window(finding), base.recorded.bag
    if window is None or not finding.signals:
        return False
    begin, end = round((window[0] - AROUND) * 1e9), round((window[1] + AROUND) * 1e9)
    latched = ALSO.get(finding.group, ())
    if _messages(bag, latched) != _messages(damaged, latched):
        return False
    if finding.group == "contact":
        present, telling = set(_messages(damaged, finding.signals)), _telling(bag, finding, begin, end)
        if telling and all(one in present for one in telling):
            return True
    return _inside(bag, finding.signals, begin, end) == _inside(damaged, finding.signals, begin, end)


def _messages(bag: RawBag, topics: Iterable[str]) -> list[tuple[str, int, bytes]]:
    return [(connection.topic, time, raw) for connection, time, raw in bag.rows if connection.topic in topics]


def _inside(bag: RawBag, topics: Iterable[str], begin: int, end: int) -> list[tuple[str, int, bytes]]:
    return [one for one in _messages(bag, topics) if begin <= one[1] <= end]


def _telling(bag: RawBag, finding: Finding, begin: int, end: int) -> list[tuple[str, int, bytes]]:
    """Messages that show a contact alone: that of the largest peak, and of the largest force of what is held."""
    rows = [
        (contact, (connection.topic, time, raw))
        for connection, time, raw in bag.rows
        if connection.msgtype == CONTACTS and connection.topic in finding.signals and begin <= time <= end
        for message in [bag.deserialize(raw, connection.msgtype)]
        for contact in (*message.touching, *message.ended)
        if set(contact.regions) & set(finding.regions)
    ]
    held = [row for row in rows if row[0].duration > episode_table()["transient_time"]]
    found = [max(reversed(rows), key=lambda row: float(row[0].peak))] if rows else []
    found += [max(held, key=lambda row: float(row[0].force))] if held else []
    return [row for _, row in found]
