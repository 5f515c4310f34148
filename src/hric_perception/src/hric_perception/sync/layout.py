"""What is synchronised, and how: read from a mapping, such as a YAML file's. No ROS but the classes of its messages."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from hric_control.errors import ParameterError
from hric_perception.section import Section
from hric_perception.sync.extract import BATCHES
from hric_perception.sync.interpolation import EXACT, HOLD, LINEAR, NEAREST, SLERP
from hric_perception.sync.paths import WHOLES, Leaf, leaves, message_class

RESAMPLE, APPROXIMATE = "resample", "approximate"
POLICIES = (EXACT, APPROXIMATE, RESAMPLE)
# Defaults of this file are our choice.
RATE = 100.0
TOLERANCE = 0.01
DELAY = 0.25
"""How long an instant waits for a source that is late [s]; more than the latency of any sensor here."""
TIMEOUT = 0.5
"""A source that is silent for so long starves [s of wall time]: named within a second."""
MAX_GAP = 0.1
CAPACITY = 8192
"""Samples kept per source: 4 s at 2 kHz."""


@dataclass(frozen=True)
class Column:
    """One value of the synchronised sample.

    Attributes:
        leaf: the number of the message.
        interpolation: how it is brought to the instant.
        unit: empty: the message tells, or nobody.
    """

    leaf: Leaf
    interpolation: str
    unit: str


@dataclass(frozen=True)
class Source:
    """A topic that values are taken from.

    Attributes:
        topic: as given.
        message: class of its messages.
        columns: in the order of the values.
        max_gap: the furthest that samples may be apart to be interpolated, or in the past to be held [s].
        timeout: silence after which it starves [s of wall time].
        capacity: samples kept.
    """

    topic: str
    message: Any
    columns: tuple[Column, ...]
    max_gap: float = MAX_GAP
    timeout: float = TIMEOUT
    capacity: int = CAPACITY

    @property
    def batched(self) -> bool:
        """Whether its messages hold many samples."""
        return self.message._type in BATCHES


@dataclass(frozen=True)
class Plan:
    """All of it.

    Attributes:
        policy: one of `POLICIES`.
        sources: at least one.
        reference: number of the source whose stamps are the instants; None with policy resample.
        rate: of the instants, policy resample [Hz].
        tolerance: of policy approximate [s].
        delay: how long an instant waits for a late source [s of run time].
        mark: whether instants at which a source has nothing go out, marked, or are dropped.
    """

    policy: str
    sources: tuple[Source, ...]
    reference: int | None = None
    rate: float = RATE
    tolerance: float = TOLERANCE
    delay: float = DELAY
    mark: bool = True

    @property
    def names(self) -> list[str]:
        """Of the values: topic and field."""
        return [f"{source.topic}.{column.leaf}" for source in self.sources for column in source.columns]


def read_plan(where: str, content: Any) -> Plan:
    """The plan that a mapping describes; INTERFACE.md lists its keys.

    Args:
        where: full name of the mapping, for messages.
        content: the mapping.

    Raises:
        HricError: a key, value, type or field that is not valid; the message names it and the valid ones.
    """
    section = Section(where, content)
    section.only("policy", "rate", "reference", "tolerance", "delay", "incomplete", "sources")
    policy = section.text("policy", RESAMPLE, POLICIES)
    entries = section.content.get("sources")
    if not isinstance(entries, list | tuple) or not entries:
        raise ParameterError(f"{where}.sources is {entries!r}; valid: a list of mappings with topic, type and signals")
    sources = tuple(_source(Section(f"{where}.sources[{index}]", entry), policy) for index, entry in enumerate(entries))
    topics = [source.topic for source in sources]
    _once(topics, f"{where}.sources", "each topic once, with all its signals")
    plan = Plan(
        policy=policy,
        sources=sources,
        reference=_reference(section, policy, topics),
        rate=section.number("rate", RATE, 0.0, 10_000.0, above=True),
        tolerance=section.number("tolerance", TOLERANCE, 0.0, 10.0, above=True),
        delay=section.number("delay", DELAY, 0.0, 10.0),
        mark=section.text("incomplete", "mark" if policy == RESAMPLE else "drop", ("mark", "drop")) == "mark",
    )
    _once(plan.names, f"{where}.sources", "each value once")
    return plan


def _once(names: list[str], where: str, valid: str) -> None:
    if doubles := sorted({name for name in names if names.count(name) > 1}):
        raise ParameterError(f"{where} names {', '.join(doubles)} more than once; valid: {valid}")


def _reference(section: Section, policy: str, topics: list[str]) -> int | None:
    given = section.text("reference", "")
    if policy == RESAMPLE:
        if given:
            raise ParameterError(f"{section.where}.reference is {given!r}, but the reference of policy {RESAMPLE} is a rate; valid: rate, in Hz")
        return None
    if "rate" in section.content:
        raise ParameterError(f"{section.where}.rate is given, but the reference of policy {policy} is a topic; valid: reference, one of {topics}")
    if given not in topics:
        raise ParameterError(f"{section.where}.reference is {given!r}; valid: one of {', '.join(topics)}")
    return topics.index(given)


def _source(section: Section, policy: str) -> Source:
    section.only("topic", "type", "signals", "max_gap", "timeout", "capacity")
    topic = section.text("topic")
    if not topic:
        raise ParameterError(f"{section.where}.topic is missing; valid: the name of a topic")
    kind = message_class(section.text("type"), f"{section.where}.type")
    signals = section.content.get("signals")
    if not isinstance(signals, list | tuple) or not signals:
        raise ParameterError(f"{section.where}.signals is {signals!r}; valid: a list of fields, or of mappings with field, interpolation, unit")
    columns = [column for index, signal in enumerate(signals) for column in _columns(f"{section.where}.signals[{index}]", signal, kind, policy)]
    if kind._type in BATCHES:
        BATCHES[kind._type]([column.leaf for column in columns], section.where)
    return Source(
        topic=topic,
        message=kind,
        columns=tuple(columns),
        max_gap=section.number("max_gap", MAX_GAP, 0.0, above=True),
        timeout=section.number("timeout", TIMEOUT, 0.0, 3600.0, above=True),
        capacity=section.whole("capacity", CAPACITY, 2, 10_000_000),
    )


def _columns(where: str, signal: Any, kind: Any, policy: str) -> list[Column]:
    section = Section(where, {"field": signal} if isinstance(signal, str) else signal)
    section.only("field", "interpolation", "unit")
    found = leaves(kind, section.text("field"), f"{where}.field")
    if policy != RESAMPLE:
        if "interpolation" in section.content:
            raise ParameterError(f"{where}.interpolation is given, but policy {policy} takes samples as they are; valid: policy {RESAMPLE}")
        ways = [EXACT if policy == EXACT else NEAREST] * len(found)
    else:
        ways = _interpolations(section, found)
    unit = section.text("unit")
    return [Column(replace(leaf), way, unit or leaf.unit) for leaf, way in zip(found, ways, strict=True)]


def _interpolations(section: Section, found: list[Leaf]) -> list[str]:
    """A quaternion turns, one that is not whole is held, and so are whole numbers; all else lies on a line."""
    if "interpolation" not in section.content:
        return [SLERP if leaf.quaternion else HOLD if leaf.part or leaf.kind in WHOLES else LINEAR for leaf in found]
    given = section.text("interpolation", "", (LINEAR, HOLD, SLERP))
    if given == SLERP and not all(leaf.quaternion for leaf in found):
        raise ParameterError(f"{section.where}.interpolation is {SLERP} for what is no whole quaternion; valid: {LINEAR}, {HOLD}")
    return [given] * len(found)
