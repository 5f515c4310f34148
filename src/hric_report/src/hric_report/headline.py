"""Headline of a report: the key figures of a run or of a comparison, each with its meaning."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_analysis import human, stability, supervised
from hric_assessment.findings import Outcome

GOOD, BAD, PLAIN = "good", "bad", "plain"
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
"""Factors and SI prefixes of units, down to the resolution of the positions of a run."""
PERSON = "human::"
"""Prefix of the person's link names; their contacts are judged by the verdict, not shown as a bare force."""


@dataclass(frozen=True)
class Finding:
    """Key figure of a report.

    Attributes:
        name: name of the quantity.
        value: value with its unit.
        meaning: explanation in one sentence without a full stop.
        kind: good, bad or plain.
    """

    name: str
    value: str
    meaning: str
    kind: str = PLAIN


def of_run(
    run: Mapping[str, Any], metrics: Mapping[str, Any], verdict: Mapping[str, Any] | None = None
) -> list[Finding]:
    """Return the key figures of a run: failures, contacts, marker tracking, setpoints, lost samples, stability.

    Args:
        run: contents of run.yaml.
        metrics: contents of metrics.json.
        verdict: contents of verdict.json; None: there was no person, or the run was not judged.
    """
    found = [*_problems(run, metrics), *_judged(verdict)]
    if metrics.get("tracking"):
        found += _tracking(metrics["tracking"])
    if metrics.get("human"):
        found += _human(metrics["human"])
    if metrics.get("supervisor"):
        found += _supervised(metrics["supervisor"])
    if metrics["setpoints"]:
        found += _setpoints(metrics["setpoints"])
    if metrics.get("sources"):
        found += _recorded(metrics["sources"])
    if metrics.get("sync"):
        found += _skew(metrics["sync"])
    pairs = [one for one in metrics.get("contacts") or () if PERSON not in f"{one['body_a']} {one['body_b']}"]
    if pairs:
        strongest = max(pairs, key=lambda one: one["peak_force"])
        pair = f"{strongest['body_a']} on {strongest['body_b']}, the strongest contact ({strongest['kind']})"
        bodies = {strongest[key].removeprefix("human::") for key in ("body_a", "body_b")}
        blows = [one for one in (metrics.get("human") or {}).get("contacts", ()) if one["transient"]]
        if not any(bodies == {one["link"], one["other"]} for one in blows):  # these are listed by their body region
            found.append(Finding("Contact force", scaled(strongest["peak_force"], "N"), pair))
    if metrics["stability"]["verdict"] == stability.STABLE:
        found.append(Finding("Stability", stability.STABLE, "no joint chatters and nothing diverged", GOOD))
    return found


def _judged(verdict: Mapping[str, Any] | None) -> list[Finding]:
    """Return the worst finding of the person's contacts; verdict.json lists the worst findings first."""
    found = next((one for one in (verdict or {}).get("findings", ()) if one["group"] == "contact"), None)
    if found is None:
        return []
    share = "" if found["share"] is None else f", {100.0 * found['share']:.0f} % of the limit"
    kind = {Outcome.WITHIN: GOOD, Outcome.ABOVE: BAD}.get(found["outcome"], PLAIN)
    meaning = f"{found['subject']}: {found['reason']}, estimate of a model"
    return [Finding("Contact with the person", f"{found['outcome']}{share}", meaning, kind)]


def _human(found: Mapping[str, Any]) -> list[Finding]:
    of_model = "estimate of a model"
    result = [
        Finding("Grip force", scaled(grip["force_max"], "N"), f"largest force of grip {name}, {of_model}")
        for name, grip in found["grips"].items()
        if grip["force_max"] is not None
    ]
    for one in found.get("carried", ()):
        for name, share in (one["load_share"] or {}).items():
            meaning = f"of the weight of {one['object']} on grip {name}, mean of the motion, {of_model}"
            result.append(Finding("Load share", f"{100 * share['mean']:.1f} %", meaning))
        meaning = f"what cancels of both forces on {one['object']}, at most, {of_model}"
        result.append(Finding("Squeeze", scaled(max(one["squeeze_max"], one["stretch_max"]), "N"), meaning))
    joint, peak = max(found["joints"].items(), key=lambda item: item[1]["share_max"])
    share = f"{100 * peak['share_max']:.0f} %"
    result.append(Finding("Share of strength", share, f"{joint}, the most loaded joint of the human, {of_model}"))
    settling = found["settling"]
    if settling is not None:
        kind = GOOD if settling["verdict"] == human.SETTLES else BAD
        text = f"grip force and hand speed within {human.SETTLING_TIME:g} s after the motion"
        result.append(Finding("After the motion", settling["verdict"], text, kind))
    return result


def _supervised(found: Mapping[str, Any]) -> list[Finding]:
    stopped, slowed = (f"{100.0 * found[key]:.1f} %" for key in ("share_stopped", "share_slowed"))
    violations = found["violations"]
    kept = Finding(
        "Nearer than the protective distance",
        _count(len(violations), "time"),
        f"{supervised.said(found).lower()}, estimate of a model",
        BAD if violations else GOOD,
    )
    return [Finding("Stopped", stopped, f"of the time, by the supervisor, which slowed for another {slowed}"), kept]


def of_comparison(first: str, pairs: Mapping[str, Sequence[Mapping[str, Any]]]) -> list[Finding]:
    """Return the largest differences in joint position of each run from the first run.

    Args:
        first: name of the run that the others are compared with.
        pairs: differences per setpoint, as `comparison.difference_metrics` returns them, by name of the other run.
    """
    found = []
    for name, moves in pairs.items():
        joints = [(joint, one) for move in moves for joint, one in move["joints"].items()]
        if not joints:
            continue
        joint, one = max(joints, key=lambda item: abs(item[1]["peak_difference"]))
        meaning = f"{joint} after {one['peak_time']:.3f} s: {first} minus {name}"
        if not one["peak_difference"]:
            meaning = f"all positions of {first} and {name} are equal"
        found.append(Finding("Peak difference", scaled(abs(one["peak_difference"]), "rad"), meaning))
        joint, one = max(joints, key=lambda item: abs(item[1]["steady_difference"]))
        meaning = f"{joint}, mean of the last 0.1 s of a setpoint's time: {first} minus {name}"
        found.append(Finding("Steady difference", scaled(abs(one["steady_difference"]), "rad"), meaning))
    return found


def scaled(value: float | None, unit: str) -> str:
    """Format a value with three significant digits and its unit, with an SI prefix if small; None: "not known"."""
    if value is None or not math.isfinite(value):
        return "not known"
    factor, prefix = next(((f, p) for f, p in PREFIXES if abs(value) >= f), PREFIXES[-1])
    if value == 0.0:
        factor, prefix = PREFIXES[0]
    return f"{_digits(value / factor)} {prefix}{unit}"


def _digits(value: float) -> str:
    """Format a value with three significant digits, without an exponent."""
    if value == 0.0:
        return "0"
    return f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' if number != 1 else ''}"


def _problems(run: Mapping[str, Any], metrics: Mapping[str, Any]) -> list[Finding]:
    found = []
    if reason := run.get("error") or run.get("reason"):
        what = "The run failed" if run.get("error") else "The run did not end by itself"
        found.append(Finding(what, str(run.get("status", "failed")), str(reason), BAD))
    if metrics["stability"]["verdict"] not in (None, stability.STABLE):
        first, *others = metrics["stability"]["reasons"] or ["for no reason that is known"]
        meaning = f"{first}; {len(others)} more below" if others else first
        found.append(Finding("Stability", str(metrics["stability"]["verdict"]), meaning, BAD))
    if reflexes := metrics.get("reflexes"):
        first = f"the arm protected itself, first at {reflexes[0]['time']:.3f} s: {', '.join(reflexes[0]['errors'])}"
        found.append(Finding("Reflexes", str(len(reflexes)), first, BAD))
    return found


def _tracking(values: Mapping[str, Any]) -> list[Finding]:
    if values["rms_error"] is None:
        return [Finding("Marker", "none", f"no valid marker of {values['body'] or 'any body'} came", BAD)]
    against = "the true position of the hand" if values["marker"] == "truth" else "the motion capture"
    lag = "not known" if values["lag"] is None else f"{1e3 * values['lag']:.1f} ms"
    found = [
        Finding("Lag", lag, f"how long the end effector is behind the marker, by {against}"),
        Finding(
            "Error after the lag",
            f"{1e3 * values['rms_error']:.2f} mm",
            f"RMS distance from where the marker was a lag before; largest {1e3 * values['largest_error']:.2f} mm",
        ),
    ]
    ratio = (values["acceleration"] or {}).get("ratio")
    if ratio:
        meaning = "RMS acceleration of the end effector by the marker's own: 1 is as smooth as the marker"
        found.append(Finding("Acceleration", f"{ratio:.2f} ×", meaning))
    frames = values["frames"]
    missing = frames["lost"] + frames["untracked"]
    meaning = f"{frames['lost']} frames lost, {frames['untracked']} without the body, of {frames['received']}"
    lost = Finding(
        "Marker lost", _count(values["losses"], "time"), meaning, BAD if values["losses"] or missing else GOOD
    )
    return [*found, lost]


def _setpoints(moves: Sequence[Mapping[str, Any]]) -> list[Finding]:
    """Return final error, settling time and overshoot of the worst joint over all setpoints."""
    joints = [(name, joint) for move in moves for name, joint in move["joints"].items()]
    number = _count(len(moves), "setpoint") if len(moves) > 1 else "the setpoint"
    name, worst = max(joints, key=lambda item: abs(item[1]["final_error"]))
    meaning = f"largest distance from {number} at the end of its time, {name}"
    found = [Finding("Final error", scaled(abs(worst["final_error"]), "rad"), meaning)]
    band = min(worst["settling_time"], key=float)
    times = [(joint["settling_time"][band], name) for name, joint in joints]
    if outside := list(dict.fromkeys(name for time, name in times if time is None)):
        meaning = f"not within {band} rad at the end of a setpoint's time: {', '.join(outside)}"
        found.append(Finding("Settling time", "never", meaning, BAD))
    else:
        time, name = max((time, name) for time, name in times if time is not None)
        meaning = f"until all joints stay within {band} rad, the last {name}"
        found.append(Finding("Settling time", f"{time:.2f} s", meaning))
    name, worst = max(joints, key=lambda item: float(item[1]["overshoot"]))
    return [*found, Finding("Overshoot", scaled(worst["overshoot"], "rad"), f"farthest past a setpoint, {name}")]


def _recorded(sources: Mapping[str, Mapping[str, Any]]) -> list[Finding]:
    """Return the number of sent samples missing in the bag; empty if fewer than two sources count their samples."""
    counted = {topic: one for topic, one in sources.items() if one["sent"] is not None}
    unknown = len(sources) - len(counted)
    if len(counted) < 2:
        return []
    sent, recorded, lost = (sum(one[key] for one in counted.values()) for key in ("sent", "recorded", "lost"))
    worst = ", ".join(topic for topic, one in counted.items() if one["lost"])
    note = f"; what {unknown} more sent is not known" if unknown else ""
    meaning = f"{recorded:,} of {sent:,} samples that {len(counted)} sources sent are in the bag{note}"
    return [Finding("Samples lost", f"{lost:,}", f"{meaning}: {worst}" if worst else meaning, BAD if lost else GOOD)]


def _skew(streams: Mapping[str, Mapping[str, Any]]) -> list[Finding]:
    """Return the largest time skew of synchronised values, and the number of missing instants."""
    known = [
        (part["skew"]["p99"], source, part["by"], stream["bound"])
        for stream in streams.values()
        for source, part in stream["sources"].items()
        if part["skew"] is not None
    ]
    found = []
    if known:
        skew, source, by, bound = max(known)
        meaning = f"99 % of the values are closer in time to their instants; worst source {source}, by the {by}"
        kind = GOOD if skew <= bound else BAD
        found.append(Finding("Skew", f"{1e3 * skew:.3f} ms", f"{meaning}; stated: {1e3 * bound:g} ms", kind))
    missing = [stream["missing"] for stream in streams.values() if stream["missing"] is not None]
    if missing:
        ticks = sum(stream["ticks"] for stream in streams.values())
        meaning = f"of {ticks + sum(missing):,} common instants in {_count(len(streams), 'synchronised stream')}"
        found.append(Finding("Instants missing", f"{sum(missing):,}", meaning, BAD if sum(missing) else GOOD))
    return found
