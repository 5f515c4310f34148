"""Plan of a synchronisation, read from a mapping such as a YAML file. Of ROS, only message classes are used."""

from dataclasses import dataclass
from typing import Any

from hric_core.errors import ParameterError
from hric_core.parameters import Settings, choice, either, listing, number, refused, section, text, whole
from hric_perception.sync.extract import BATCHES
from hric_perception.sync.paths import WHOLES, Leaf, leaves, message_class

RESAMPLE, APPROXIMATE, EXACT = "resample", "approximate", "exact"
POLICIES = (EXACT, APPROXIMATE, RESAMPLE)
LINEAR, HOLD, SLERP, NEAREST = "linear", "hold", "slerp", "nearest"
"""Methods that give a source's value at an instant; policy resample uses the first three."""
# Defaults of this file are project defaults, unconfirmed.
RATE = 100.0
TOLERANCE = 0.01
DELAY = 0.25
"""Longest time that an instant waits for a delayed source [s]; more than the latency of any supported sensor."""
TIMEOUT = 0.5
"""Silence after which a source counts as starving [s of wall time]."""
MAX_GAP = 0.1
CAPACITY = 8192
"""Number of samples stored per source: 4 s at 2 kHz."""


@dataclass(frozen=True)
class SyncColumn:
    """One value of a synchronised sample.

    Attributes:
        leaf: numeric field of the source's message, such as `pose.position.x`.
        interpolation: method that gives the value at an instant.
        unit: unit of the value; empty: that of the message, if it has one.
    """

    leaf: Leaf
    interpolation: str
    unit: str


@dataclass(frozen=True)
class SyncSource:
    """Source of a synchronisation: topic from which values are taken.

    Attributes:
        topic: topic name as in the plan.
        message: class of the topic's messages.
        columns: values taken from a message, in their order.
        max_gap: longest time between samples for interpolation, or largest age of a held sample [s].
        timeout: silence after which the source starves [s of wall time].
        capacity: number of stored samples.
    """

    topic: str
    message: Any
    columns: tuple[SyncColumn, ...]
    max_gap: float = MAX_GAP
    timeout: float = TIMEOUT
    capacity: int = CAPACITY

    @property
    def batched(self) -> bool:
        """True if a message of this source contains many samples."""
        return self.message._type in BATCHES


@dataclass(frozen=True)
class SyncPlan:
    """Sources, instants and policy of a synchronisation.

    Attributes:
        policy: one of `POLICIES`.
        sources: sources, at least one.
        reference: index of the source whose stamps are the instants; None with policy resample.
        rate: rate of the instants with policy resample [Hz].
        tolerance: largest time between sample and instant with policy approximate [s].
        delay: how long an instant waits for a delayed source [s of robot time].
        mark: True: instants at which a source has no value are returned and marked; False: they are dropped.
    """

    policy: str
    sources: tuple[SyncSource, ...]
    reference: int | None = None
    rate: float = RATE
    tolerance: float = TOLERANCE
    delay: float = DELAY
    mark: bool = True

    @property
    def names(self) -> list[str]:
        """Names of the values: topic and field, such as joint_states.position[a]."""
        return [f"{source.topic}.{column.leaf}" for source in self.sources for column in source.columns]


@dataclass(frozen=True)
class SignalSettings(Settings):
    """Settings of signals: fields of a message, their interpolation and unit."""

    field: str = text(empty=False)
    interpolation: str | None = choice(LINEAR, HOLD, SLERP, default=None)
    unit: str = text("")


@dataclass(frozen=True)
class SourceSettings(Settings):
    """Settings of a source: topic, and signals taken from its messages."""

    topic: str = text(valid="the name of a topic", empty=False)
    type: str = text()
    signals: tuple[str | SignalSettings, ...] = listing(either(text(), section(SignalSettings)), range(1, 10_000))
    max_gap: float = number(MAX_GAP, above=0.0, unit="s")
    timeout: float = number(TIMEOUT, above=0.0, maximum=3600.0, unit="s")
    capacity: int = whole(CAPACITY, minimum=2, maximum=10_000_000)

    def source(self, policy: str) -> SyncSource:
        """Return the source that these settings describe; policy: one of `POLICIES`. Raises HricError."""
        kind = message_class(self.type, f"{self.prefix}type")
        columns = [
            column for index, signal in enumerate(self.signals) for column in self._columns(index, signal, kind, policy)
        ]
        if kind._type in BATCHES:
            BATCHES[kind._type]([column.leaf for column in columns], self.prefix.rstrip("./"))
        return SyncSource(self.topic, kind, tuple(columns), self.max_gap, self.timeout, self.capacity)

    def _columns(self, index: int, section: str | SignalSettings, kind: Any, policy: str) -> list[SyncColumn]:
        where = f"{self.prefix}signals[{index}]"
        signal = section if isinstance(section, SignalSettings) else SignalSettings(field=section)
        signal_leaves = leaves(kind, signal.field, f"{where}.field")
        if policy != RESAMPLE:
            if signal.interpolation is not None:
                raise ParameterError(
                    f"{where}.interpolation is given, but policy {policy} takes samples as they are; valid: policy "
                    f"{RESAMPLE}"
                )
            interpolations = [EXACT if policy == EXACT else NEAREST] * len(signal_leaves)
        else:
            interpolations = _interpolations(signal.interpolation, signal_leaves, where)
        return [
            SyncColumn(leaf, interpolation, signal.unit or leaf.unit)
            for leaf, interpolation in zip(signal_leaves, interpolations, strict=True)
        ]


@dataclass(frozen=True)
class PlanSettings(Settings):
    """Settings of a synchronisation plan, as in a YAML file."""

    policy: str = choice(*POLICIES, default=RESAMPLE)
    rate: float | None = number(None, above=0.0, maximum=10_000.0, unit="Hz")
    reference: str = text("")
    tolerance: float = number(TOLERANCE, above=0.0, maximum=10.0, unit="s")
    delay: float = number(DELAY, minimum=0.0, maximum=10.0, unit="s")
    incomplete: str | None = choice("mark", "drop", default=None)
    sources: tuple[SourceSettings, ...] = listing(section(SourceSettings), range(1, 10_000))

    def check(self, where: str) -> None:
        """Check that topics differ, and that `rate` or `reference` suits the policy. Raises ParameterError."""
        topics = [source.topic for source in self.sources]
        _once(topics, f"{where}sources", "each topic once, with all its signals")
        if self.policy == RESAMPLE and self.reference:
            raise refused(
                f"{where}reference", self.reference, f"rate [Hz]; the reference of policy {RESAMPLE} is a rate"
            )
        if self.policy != RESAMPLE and self.rate is not None:
            raise ParameterError(
                f"{where}rate is given, but the reference of policy {self.policy} is a topic; valid: reference, one "
                f"of {topics}"
            )
        if self.policy != RESAMPLE and self.reference not in topics:
            raise refused(f"{where}reference", self.reference, f"one of {', '.join(topics)}")


def read_plan(where: str, content: Any) -> SyncPlan:
    """Return the plan that a mapping describes; INTERFACE.md lists its keys.

    Args:
        where: full name of the mapping, for error messages.
        content: mapping of the plan.

    Raises:
        HricError: a key, value, type or field that is not valid; the message names it and the valid ones.
    """
    settings = PlanSettings.of(content, where)
    resampled = settings.policy == RESAMPLE
    plan = SyncPlan(
        policy=settings.policy,
        sources=tuple(source.source(settings.policy) for source in settings.sources),
        reference=None if resampled else [source.topic for source in settings.sources].index(settings.reference),
        rate=RATE if settings.rate is None else settings.rate,
        tolerance=settings.tolerance,
        delay=settings.delay,
        mark=(settings.incomplete or ("mark" if resampled else "drop")) == "mark",
    )
    _once(plan.names, f"{settings.prefix}sources", "each value once")
    return plan


def _once(names: list[str], where: str, valid: str) -> None:
    if doubles := sorted({name for name in names if names.count(name) > 1}):
        raise ParameterError(f"{where} names {', '.join(doubles)} more than once; valid: {valid}")


def _interpolations(method: str | None, signal_leaves: list[Leaf], where: str) -> list[str]:
    """Return a method per number; default: slerp for quaternions, hold for parts of them and integers, else linear."""
    if method is None:
        return [
            SLERP if leaf.quaternion else HOLD if leaf.part or leaf.kind in WHOLES else LINEAR for leaf in signal_leaves
        ]
    if method == SLERP and not all(leaf.quaternion for leaf in signal_leaves):
        raise ParameterError(
            f"{where}.interpolation is {SLERP}, but the field is no whole quaternion; valid: {LINEAR}, {HOLD}"
        )
    return [method] * len(signal_leaves)
