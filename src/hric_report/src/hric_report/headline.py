"""Headline of a report: the key figures of a run or of a comparison, each with its meaning."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hric_analysis import human_values, stability
from hric_analysis.collection import SourceMetrics, StreamMetrics
from hric_analysis.comparison import SetpointDifference
from hric_analysis.human_values import HumanMetrics
from hric_analysis.metrics import SetpointMetrics
from hric_analysis.supervised import SupervisorMetrics
from hric_analysis.tracking import TrackingMetrics
from hric_analysis.values import RunMetrics
from hric_assessment.findings import Outcome
from hric_bags.run_file import RunFile
from hric_report import text
from hric_report.html.verdict_file import VerdictFile

GOOD, BAD, PLAIN = "good", "bad", "plain"
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))
"""Factors and SI prefixes of units, down to the resolution of the positions of a run."""
PERSON = "human::"
"""Prefix of the person's link names; the verdict judges their contacts, so these are not shown as forces here."""
OF_MODEL = "estimate of a model"


@dataclass(frozen=True)
class KeyFigure:
    """Key figure of a report: a value that the top of the page shows.

    Attributes:
        name: name of the quantity.
        value: value with its unit.
        meaning: explanation in one sentence without a full stop.
        kind: GOOD, BAD or PLAIN, which determines the colour.
    """

    name: str
    value: str
    meaning: str
    kind: str = PLAIN


def of_run(run: RunFile, metrics: RunMetrics, verdict: VerdictFile | None = None) -> list[KeyFigure]:
    """Return the key figures of a run: failures, contacts, marker tracking, setpoints, lost samples, stability.

    Args:
        run: contents of run.yaml.
        metrics: metrics of the run.
        verdict: contents of verdict.json; None: there was no person, or the run was not assessed.
    """
    figures = [*_problems(run, metrics), *_judged(verdict)]
    figures += _tracking(metrics.tracking) if metrics.tracking else []
    figures += _human(metrics.human) if metrics.human else []
    figures += _supervised(metrics.supervisor) if metrics.supervisor else []
    figures += _setpoints(metrics.setpoints) if metrics.setpoints else []
    figures += [*_recorded(metrics.sources or {}), *_skew(metrics.sync or {}), *_contact(metrics)]
    if metrics.stability.verdict == stability.STABLE:
        figures.append(KeyFigure("Stability", stability.STABLE, "no oscillation, no divergence", GOOD))
    return figures


def _contact(metrics: RunMetrics) -> list[KeyFigure]:
    """Return the strongest contact without the person; empty if there is none or the human's impacts include it."""
    pairs = [pair for pair in metrics.contacts or () if PERSON not in f"{pair.body_a} {pair.body_b}"]
    if not pairs:
        return []
    strongest = max(pairs, key=lambda pair: pair.peak_force)
    bodies = {strongest.body_a.removeprefix(PERSON), strongest.body_b.removeprefix(PERSON)}
    impacts = [contact for contact in metrics.human.contacts if contact.transient] if metrics.human else []
    if any(bodies == {contact.link, contact.other} for contact in impacts):
        return []
    meaning = f"{strongest.body_a} on {strongest.body_b}, the strongest contact ({strongest.kind})"
    return [KeyFigure("Contact force", scaled(strongest.peak_force, "N"), meaning)]


def _judged(verdict: VerdictFile | None) -> list[KeyFigure]:
    """Return the worst finding on contacts with the person; verdict.json lists the worst findings first."""
    findings = [] if verdict is None else verdict["findings"]
    finding = next((item for item in findings if item["group"] == "contact"), None)
    if finding is None:
        return []
    share = "" if finding["share"] is None else f", {100.0 * finding['share']:.0f} % of the limit"
    kind = {str(Outcome.WITHIN): GOOD, str(Outcome.ABOVE): BAD}.get(finding["outcome"], PLAIN)
    meaning = f"{finding['subject']}: {finding['reason']}, {OF_MODEL}"
    return [KeyFigure("Contact with the person", f"{finding['outcome']}{share}", meaning, kind)]


def _human(values: HumanMetrics) -> list[KeyFigure]:
    figures = [
        KeyFigure("Grip force", scaled(grip.force_max, "N"), f"largest force of grip {name}, {OF_MODEL}")
        for name, grip in values.grips.items()
        if grip.force_max is not None
    ]
    for transport in values.carried:
        for name, share in (transport.load_share or {}).items():
            meaning = f"mean share of the weight of {transport.object} on grip {name} during the motion, {OF_MODEL}"
            figures.append(KeyFigure("Load share", f"{100 * share.mean:.1f} %", meaning))
        meaning = f"largest internal force between both grips on {transport.object}, {OF_MODEL}"
        force = scaled(max(transport.squeeze_max, transport.stretch_max), "N")
        figures.append(KeyFigure("Internal force", force, meaning))
    joint, load = max(values.joints.items(), key=lambda item: item[1].share_max)
    meaning = f"{joint}, the most loaded joint of the human, {OF_MODEL}"
    figures.append(KeyFigure("Share of strength", f"{100 * load.share_max:.0f} %", meaning))
    if values.settling is not None:
        kind = GOOD if values.settling.verdict == human_values.SETTLES else BAD
        meaning = f"grip force and hand speed within {human_values.SETTLING_TIME:g} s after the motion"
        figures.append(KeyFigure("After the motion", values.settling.verdict, meaning, kind))
    return figures


def _supervised(values: SupervisorMetrics) -> list[KeyFigure]:
    stopped, slowed = (f"{100.0 * share:.1f} %" for share in (values.share_stopped, values.share_slowed))
    return [
        KeyFigure(
            "Stopped", stopped, f"of the time the supervisor stopped the arm; for another {slowed} it slowed the arm"
        ),
        KeyFigure(
            "Closer than the protective distance",
            _count(len(values.violations), "time"),
            f"{text.violations(values).lower()}, {OF_MODEL}",
            BAD if values.violations else PLAIN if text.unjudged(values) else GOOD,
        ),
    ]


def of_comparison(first: str, pairs: Mapping[str, Sequence[SetpointDifference]]) -> list[KeyFigure]:
    """Return the largest differences in joint position of each run from the first run.

    Args:
        first: name of the run with which the others are compared.
        pairs: differences after each setpoint, by name of the other run.
    """
    figures = []
    for name, setpoints in pairs.items():
        joints = [item for setpoint in setpoints for item in setpoint.joints.items()]
        if not joints:
            continue
        joint, worst = max(joints, key=lambda item: abs(item[1].peak_difference))
        differ = f"{joint} after {worst.peak_time:.3f} s: {first} minus {name}"
        meaning = differ if worst.peak_difference else f"all positions of {first} and {name} are equal"
        figures.append(KeyFigure("Peak difference", scaled(abs(worst.peak_difference), "rad"), meaning))
        joint, worst = max(joints, key=lambda item: abs(item[1].steady_difference))
        meaning = f"{joint}, mean of the last 0.1 s before the next setpoint or the end: {first} minus {name}"
        figures.append(KeyFigure("Steady difference", scaled(abs(worst.steady_difference), "rad"), meaning))
    return figures


def scaled(value: float | None, unit: str) -> str:
    """Format a value with three significant digits and its unit, with an SI prefix if small; "not known" for None."""
    if value is None or not math.isfinite(value):
        return "not known"
    factor, prefix = next(((f, p) for f, p in PREFIXES if abs(value) >= f), PREFIXES[-1])
    if value == 0.0:
        factor, prefix = PREFIXES[0]
    return f"{_digits(value / factor)} {prefix}{unit}"


def _digits(value: float) -> str:
    """Format a value with three significant digits, without an exponent."""
    return "0" if value == 0.0 else f"{value:.{max(0, 2 - math.floor(math.log10(abs(value))))}f}"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' if number != 1 else ''}"


def _problems(run: RunFile, metrics: RunMetrics) -> list[KeyFigure]:
    figures, judged = [], metrics.stability
    if reason := run.get("error") or run.get("reason"):
        name = "The run failed" if run.get("error") else "The run did not end by itself"
        figures.append(KeyFigure(name, str(run.get("status", "failed")), str(reason), BAD))
    if judged.verdict not in (None, stability.STABLE):
        first, *others = judged.reasons or ("the reason is not known",)
        meaning = f"{first}; {len(others)} more below" if others else first
        figures.append(KeyFigure("Stability", str(judged.verdict), meaning, BAD))
    if metrics.reflexes:
        reflex = metrics.reflexes[0]
        meaning = f"the arm protected itself, first at {reflex.time:.3f} s: {', '.join(reflex.errors)}"
        figures.append(KeyFigure("Reflexes", str(len(metrics.reflexes)), meaning, BAD))
    return figures


def _tracking(values: TrackingMetrics) -> list[KeyFigure]:
    if values.rms_error is None or values.largest_error is None:
        return [KeyFigure("Marker", "none", f"no valid marker of {values.body or 'any body'} was received", BAD)]
    against = "the true position of the hand" if values.marker == "truth" else "the motion capture"
    lag = "not known" if values.lag is None else f"{1e3 * values.lag:.1f} ms"
    meaning = f"RMS distance from where the marker was one lag earlier; largest {1e3 * values.largest_error:.2f} mm"
    figures = [
        KeyFigure("Lag", lag, f"delay of the end effector behind the marker, measured against {against}"),
        KeyFigure("Error after the lag", f"{1e3 * values.rms_error:.2f} mm", meaning),
    ]
    if values.acceleration and values.acceleration.ratio:
        meaning = "RMS acceleration of the end effector divided by that of the marker; 1: as smooth as the marker"
        figures.append(KeyFigure("Acceleration", f"{values.acceleration.ratio:.2f} ×", meaning))
    frames = values.frames
    kind = BAD if values.losses or frames.lost or frames.untracked else GOOD
    meaning = f"{frames.lost} frames lost, {frames.untracked} without the body, of {frames.received}"
    return [*figures, KeyFigure("Marker lost", _count(values.losses, "time"), meaning, kind)]


def _setpoints(setpoints: Sequence[SetpointMetrics]) -> list[KeyFigure]:
    """Return final error, settling time and overshoot of the worst joint over all setpoints."""
    joints = [item for setpoint in setpoints for item in setpoint.joints.items()]
    number = _count(len(setpoints), "setpoint") if len(setpoints) > 1 else "the setpoint"
    name, worst = max(joints, key=lambda item: abs(item[1].final_error))
    meaning = f"largest distance of a joint from {number} at the end of its time: {name}"
    figures = [KeyFigure("Final error", scaled(abs(worst.final_error), "rad"), meaning)]
    band = min(worst.settling_time, key=float)
    times = [(joint.settling_time[band], name) for name, joint in joints]
    if outside := list(dict.fromkeys(name for time, name in times if time is None)):
        meaning = f"not within {band} rad at the end of a setpoint's time: {', '.join(outside)}"
        figures.append(KeyFigure("Settling time", "never", meaning, BAD))
    else:
        time, name = max((time, name) for time, name in times if time is not None)
        meaning = f"time until all joints stay within {band} rad of the setpoint; the last is {name}"
        figures.append(KeyFigure("Settling time", f"{time:.2f} s", meaning))
    name, worst = max(joints, key=lambda item: item[1].overshoot)
    return [
        *figures,
        KeyFigure("Overshoot", scaled(worst.overshoot, "rad"), f"largest distance beyond a setpoint: {name}"),
    ]


def _recorded(sources: Mapping[str, SourceMetrics]) -> list[KeyFigure]:
    """Return the number of sent samples that the bag lacks; empty if fewer than two sources report what they sent."""
    counted = {topic: source for topic, source in sources.items() if source.sent is not None}
    if len(counted) < 2:
        return []
    counts = ((source.sent or 0, source.recorded, source.lost or 0) for source in counted.values())
    sent, recorded, lost = map(sum, zip(*counts, strict=True))
    unknown = len(sources) - len(counted)
    note = f"; {unknown} more sources do not report how many they sent" if unknown else ""
    worst = ", ".join(topic for topic, source in counted.items() if source.lost)
    meaning = f"{recorded:,} of {sent:,} samples that {len(counted)} sources sent are in the bag{note}"
    kind = BAD if lost else GOOD
    return [KeyFigure("Samples lost", f"{lost:,}", f"{meaning}: {worst}" if worst else meaning, kind)]


def _skew(streams: Mapping[str, StreamMetrics]) -> list[KeyFigure]:
    """Return the largest time skew between synchronised values, and the number of instants without values."""
    known = [
        (part.skew.p99, source, part.by, stream.bound)
        for stream in streams.values()
        for source, part in stream.sources.items()
        if part.skew is not None
    ]
    figures = []
    if known:
        skew, source, by, bound = max(known)
        meaning = f"99 % of the values deviate less from their instants; worst source {source}, judged by the {by}"
        kind = GOOD if skew <= bound else BAD
        figures.append(KeyFigure("Skew", f"{1e3 * skew:.3f} ms", f"{meaning}; accepted: {1e3 * bound:g} ms", kind))
    missing = [stream.missing for stream in streams.values() if stream.missing is not None]
    if missing:
        ticks = sum(stream.ticks for stream in streams.values())
        meaning = f"of {ticks + sum(missing):,} common instants in {_count(len(streams), 'synchronised stream')}"
        kind = BAD if sum(missing) else GOOD
        figures.append(KeyFigure("Instants missing", f"{sum(missing):,}", meaning, kind))
    return figures
