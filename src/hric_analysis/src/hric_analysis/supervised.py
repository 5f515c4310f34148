"""Metrics of the supervisor of a run, for metrics.json and the report."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from hric_assessment.findings import DISCLAIMER
from hric_bags.records.safety_record import SLOWED, STOPPED, SafetyRecord

SHOWN = 12
"""Maximum number of events in the text; metrics.json has all. Project default, unconfirmed."""


def metrics(record: SafetyRecord | None) -> dict[str, Any] | None:
    """Return the metrics for metrics.json; None: there was no supervisor."""
    if record is None:
        return None
    late = record.latency[np.isfinite(record.latency)]
    median, p99 = np.percentile(late, [50, 99]).tolist() if len(late) else (None, None)
    return {
        "mode": record.mode,
        "share_stopped": record.share(STOPPED),
        "share_slowed": record.share(SLOWED),
        "scale_mean": float(np.mean(record.scale)),
        "separation_min": _smallest(record.separation),
        "violations": [{"begin": begin, "end": end} for begin, end in record.violations],
        "margin_min_violated": _smallest(record.margin[record.violation]),
        "latency": {"median": median, "p99": p99},
        "events": [
            {
                "time": one.time,
                "kind": one.kind,
                "text": one.text,
                "separation": _known(one.separation),
                "margin": _known(one.margin),
            }
            for one in record.events
        ],
    }


def _smallest(values: Any) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.min()) if len(known) else None


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def said(found: Mapping[str, Any]) -> str:
    """Return a sentence that says if the arm moved closer than the protective distance; found: from metrics.json."""
    violations = found["violations"]
    if not violations:
        return "the arm never moved nearer than the protective distance"
    long = sum(one["end"] - one["begin"] for one in violations)
    return (
        f"THE ARM MOVED NEARER THAN THE PROTECTIVE DISTANCE for {long:.2f} s in {len(violations)} stretches, by up to "
        f"{-found['margin_min_violated']:.3f} m"
    )


def render(found: Mapping[str, Any]) -> str:
    """Return the text of the report; found: `supervisor` of metrics.json."""
    nearest = found["separation_min"]
    distance = "distance not known" if nearest is None else f"smallest distance {nearest:.3f} m"
    lines = [
        f"supervisor, {found['mode']}: stopped for {100.0 * found['share_stopped']:.1f} % of the time, slowed for "
        f"{100.0 * found['share_slowed']:.1f} %; {distance}; {said(found)}"
    ]
    late = found["latency"]
    if late["median"] is not None:
        lines.append(
            f"- from a pose to the cycle that took its request up: median {1e3 * late['median']:.1f} ms, 99 % "
            f"{1e3 * late['p99']:.1f} ms"
        )
    events = found["events"]
    lines += [f"- {one['time']:.3f} s {one['kind']}: {one['text']}" for one in events[:SHOWN]]
    if left := Counter(one["kind"] for one in events[SHOWN:]):
        lines.append("- and " + ", ".join(f"{count} {kind}" for kind, count in left.items()))
    return "\n".join([*lines, DISCLAIMER])
