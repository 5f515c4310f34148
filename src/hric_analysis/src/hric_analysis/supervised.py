"""Metrics of the safety supervisor in a run."""

import math
from dataclasses import dataclass

import numpy as np

from hric_bags.reader import FloatArray
from hric_bags.records.safety_record import SLOWED, STOPPED, SafetyRecord


@dataclass(frozen=True)
class TimeInterval:
    """Time interval: begin and end, robot time [s]."""

    begin: float
    end: float


@dataclass(frozen=True)
class Latency:
    """Delay from a measured pose of the person to the control cycle that applied the supervisor's request.

    Attributes:
        median, p99: median and 99 % quantile [s]; None: not known.
    """

    median: float | None
    p99: float | None


@dataclass(frozen=True)
class SupervisorEvent:
    """Event that the supervisor reported.

    Attributes:
        time: robot time [s].
        kind, text: kind and description, as in hric_msgs/SafetyEvent.
        separation, margin: distance between arm and person at this time, and this distance minus the protective
            distance [m]; None: not known.
    """

    time: float
    kind: str
    text: str
    separation: float | None
    margin: float | None


@dataclass(frozen=True)
class SupervisorMetrics:
    """Decisions of the safety supervisor during a run.

    Attributes:
        mode: mode of the supervisor.
        share_stopped, share_slowed: shares of the time in which the arm was stopped, and slowed [1].
        scale_mean: mean of the requested speed scale [1].
        separation_min: smallest known distance between arm and person [m]; None: never known.
        violations: intervals in which the arm moved closer than the protective distance.
        margin_min_violated: smallest distance minus protective distance in these intervals [m]; None: there is none.
        latency: delay from a measured pose to the cycle that applied the request.
        events: events in the order of time.
        share_unknown: share of the time in which the distance was not known [1]; None: an older record.
    """

    mode: str
    share_stopped: float
    share_slowed: float
    scale_mean: float
    separation_min: float | None
    violations: tuple[TimeInterval, ...]
    margin_min_violated: float | None
    latency: Latency
    events: tuple[SupervisorEvent, ...]
    share_unknown: float | None = None


def metrics(record: SafetyRecord | None) -> SupervisorMetrics | None:
    """Return the metrics of a recorded supervisor; None: there was none."""
    if record is None:
        return None
    late = record.latency[np.isfinite(record.latency)]
    return SupervisorMetrics(
        record.mode,
        record.share(STOPPED),
        record.share(SLOWED),
        float(np.mean(record.scale)),
        _smallest(record.separation),
        tuple(TimeInterval(begin, end) for begin, end in record.violations),
        _smallest(record.margin[record.violation]),
        Latency(*np.percentile(late, [50, 99]).tolist()) if len(late) else Latency(None, None),
        tuple(
            SupervisorEvent(event.time, event.kind, event.text, _known(event.separation), _known(event.margin))
            for event in record.events
        ),
        record.share_unknown,
    )


def _smallest(values: FloatArray) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.min()) if len(known) else None


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
