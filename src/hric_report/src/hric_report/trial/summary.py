"""Summary of a trial: content of trial.json, and sentences on fit, known joints, moments and loads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hric_assessment.ergonomics.lumbar import LumbarLoad, level, lumbar
from hric_bags import text
from hric_core.geometry import FloatArray
from hric_human.body import Body
from hric_human.body.segments import Builder
from hric_motion.handovers import GRIPPED, handover_of
from hric_motion.measured import KNOWN, MAX_DISTANCE
from hric_motion.moments import HICKS, RECOMMENDED, JointMoments, half_width_of, joint_force
from hric_motion.trial import MEASURES, TrialMotion
from hric_motion.vendor import compared
from hric_report.trial import emg

Numbers = dict[str, float | None]
ENDS = ("low_end", "low", "high", "high_end")
"""Keys of a moment in trial.json: lower end of the 95 % interval, smallest and largest value, upper end."""
WAIST = "trunk_flex"
"""Joint whose moment and force load the lumbar spine."""


@dataclass(frozen=True)
class JointSummary:
    """Range of a joint angle in a trial, and the share of frames in which it is known.

    Attributes:
        name: name of the joint.
        known: share of the frames in which the angle is known [1].
        low, high: smallest and largest known angle [deg]; None: never known.
        deviation: root mean square of the standard deviation where the angle is known [deg]; None: never known.
        reason: reason why the angle is not known in some frames; "": it is known in all.
    """

    name: str
    known: float
    low: float | None
    high: float | None
    deviation: float | None
    reason: str


def joint_summaries(result: TrialMotion) -> list[JointSummary]:
    """Return the summary of each joint."""
    motion, fitted = result.motion, np.isfinite(result.motion.root[:, 0])
    summaries = []
    for column, (name, joint) in enumerate(motion.body.joints.items()):
        known = np.isfinite(motion.q[:, column])
        angles, spread = np.degrees(motion.q[known, column]), np.degrees(motion.spread[:, column])
        values = (angles.min(), angles.max(), np.sqrt(np.mean(spread[known] ** 2))) if known.any() else (None,) * 3
        reasons = [] if fitted.all() else [f"the body does not fit in {_percent((~fitted).mean())} of the frames"]
        lost = fitted & ~known
        if lost.any():
            alone = np.degrees(joint.range[1] - joint.range[0]) / np.sqrt(12.0)
            worn = _beyond(motion.body, motion.names, joint.link)
            reasons.append(
                f"{', '.join(worn) or 'no markers'} on its segment and beyond: +- {np.median(spread[lost]):.0f} deg in "
                f"{_percent(lost.mean())} of the frames, {alone:.0f} deg without markers"
            )
        low, high, deviation = (None if value is None else float(value) for value in values)
        summaries.append(JointSummary(name, float(known.mean()), low, high, deviation, "; ".join(reasons)))
    return summaries


def _beyond(body: Body, names: Sequence[str], link: str) -> list[str]:
    """Return the names of the markers on a link and on all links beyond it, away from the root."""
    parents = {segment.link: segment.parent for segment in body.segments.values()}

    def carried(at: str) -> bool:
        return at == link or (at in parents and carried(parents[at]))

    return [name for name in names if carried(body.markers[name].link)]


def moment_values(moments: JointMoments) -> dict[str, Any]:
    """Return the key `moments` of trial.json.

    It has the share of frames in which each joint's moment is known, its ENDS [N m], and the residual force as share of
    the body weight [1].
    """
    joints = {}
    for name, column, half in zip(moments.body.joints, moments.moment.T, moments.half_width.T, strict=True):
        known = np.isfinite(column)
        values, width = column[known], half[known]
        curves = values - width, values, values, values + width
        picks = (np.min, np.min, np.max, np.max)
        ends = [_finite(pick(curve)) if len(values) else None for pick, curve in zip(picks, curves, strict=True)]
        joints[name] = {"known": len(values) / len(column), **dict(zip(ENDS, ends, strict=True))}
    standing = {foot: list(plates) for foot, plates in moments.standing.items()}
    residual = _finite(moments.residual_share)
    return {
        "joints": joints,
        "residual": residual,
        "plates": standing,
        "hands": moments.hands,
        "notes": list(moments.notes),
    }


def _lumbar(moments: JointMoments) -> LumbarLoad:
    moment = moments.moment[:, list(moments.body.joints).index(WAIST)]
    return lumbar(moment, joint_force(moments, WAIST), moments.body.segments["torso"].p_parent_link[2])


def lumbar_values(moments: JointMoments) -> dict[str, Any] | None:
    """Return the key `lumbar` of trial.json: largest load of the lumbar spine [N] and its level; None: not known.

    The 95 % interval is that of the model plus that of angles, mass and lengths; its upper end decides the level.
    """
    load = _lumbar(moments)
    known = np.isfinite(load.compression)
    if not known.any():
        return None
    half = half_width_of(moments, lambda varied: _lumbar(varied).compression)
    load = replace(load, low=load.low - half, high=load.high + half)
    peaks = {key: float(np.nanmax(getattr(load, key))) for key in ("compression", "low", "high", "shear")}
    return {"known": float(known.mean()), **peaks, "level": level(peaks["high"])}


def content(
    result: TrialMotion, moments: JointMoments | None = None, activity: emg.TrialEmg | None = None
) -> dict[str, Any]:
    """Return the content of trial.json, in SI units and degrees, except the names and hashes of files.

    A value None means not known.

    Args:
        result: motion in the trial.
        moments: joint moments; None: not known.
        activity: measured EMG and estimated activation; None: the trial has no EMG.
    """
    motion = result.motion
    table, fitted = Builder(result.subject).lengths, motion.body.subject.lengths
    markers = zip(motion.names, motion.before, motion.after, strict=True)
    residual = motion.residual[np.isfinite(motion.residual)]
    handover = handover_of(result.trial)
    return {
        "marker_set": result.marker_set,
        "prefix": result.prefix,
        "rate": result.trial.rate,
        "frames": len(motion.q),
        "subject": {key: getattr(result.subject, key) for key in (*MEASURES, "parts")},
        "sources": dict(result.sources),
        "lengths": {name: {"table": float(table[name]), "fitted": float(fitted[name])} for name in table},
        "markers": {
            name: {"label": result.labels.get(name), "before": _finite(before), "after": _finite(after)}
            for name, before, after in markers
        },
        "noise": float(motion.noise),
        "residual": {name: float(np.quantile(residual, q)) for name, q in (("median", 0.5), ("p95", 0.95), ("max", 1))},
        "fitted": float(np.isfinite(motion.root[:, 0]).mean()),
        "joints": {one.name: vars(one) for one in joint_summaries(result)},
        "unknown": list(motion.unknown),
        "vendor": {
            one.joint: {"angle": one.theirs, "frames": one.frames}
            | {key: float(np.degrees(getattr(one, key))) for key in ("rms", "offset", "varying")}
            for one in compared(dict(zip(motion.body.joints, motion.q.T, strict=True)), result.trial.angles)
        },
        "moments": None if moments is None else moment_values(moments),
        "lumbar": None if moments is None else lumbar_values(moments),
        "emg": emg.content(activity),
        "handover": None if handover is None else vars(handover),
        "notes": list(result.notes),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.01 else "less than 1 %"


def before(values: Mapping[str, Any]) -> FloatArray:
    """Return the known root mean square distances of markers from the body before the fit, shape (n,) [m]."""
    return np.array([one["before"] for one in values["markers"].values() if one["before"] is not None])


def fit_line(values: Mapping[str, Any]) -> str:
    """Return a sentence on how well the body fits; values: content of trial.json."""
    return (
        f"The markers are {1e3 * values['residual']['median']:.1f} mm from the fitted body (median of the frames; "
        f"{1e3 * float(np.sqrt(np.mean(before(values) ** 2))):.0f} mm from the body of the table); it fits within "
        f"{1e3 * MAX_DISTANCE:.0f} mm in {_percent(values['fitted'])} of the frames."
    )


def known_line(values: Mapping[str, Any]) -> str:
    """Return a sentence on the known and unknown joint angles; values: content of trial.json."""
    joints, unknown = values["joints"], values["unknown"]
    partly = [name for name, one in joints.items() if name not in unknown and one["known"] < 1.0]
    parts = [f"{len(joints) - len(unknown)} of {len(joints)} joint angles are known"]
    parts += [f"not known: {', '.join(unknown)}"] if unknown else []
    parts += [f"with gaps: {', '.join(partly)}"] if partly else []
    return (
        "; ".join(parts) + f". An angle is known if its deviation is below {100 * KNOWN:.0f} % of that without markers."
    )


def moment_line(values: Mapping[str, Any]) -> str:
    """Return a sentence on the joint moments; values: content of trial.json."""
    moments = values["moments"]
    if moments is None:
        return "Joint moments are not known; the reason is among the notes."
    joints = moments["joints"]
    unknown = [name for name, one in joints.items() if not one["known"]]
    parts = [f"{len(joints) - len(unknown)} of {len(joints)} joint moments are known"]
    parts += [f"load on the hands: {moments['hands']}"] if moments["hands"] else []
    if sizes := {
        name: max(-one["low_end"], one["high_end"]) for name, one in joints.items() if one["low_end"] is not None
    }:
        name = max(sizes, key=sizes.__getitem__)
        low, high = (f"{joints[name][key]:.0f}" for key in ("low", "high"))
        parts.append(f"largest: {name}, {low} to {high} N m, up to {sizes[name]:.0f} N m at the worse end (95 %)")
    parts += [f"not known: {', '.join(unknown)}"] if unknown else []
    if moments["residual"] is not None:
        parts.append(
            f"the residual force is {100.0 * moments['residual']:.1f} % of the body weight (root mean square; "
            f"recommended: up to {100.0 * RECOMMENDED:.0f} %, {HICKS})"
        )
    elif any(moments["plates"].values()):
        parts.append("the residual force is not known, as heel or toe of a resting foot is always off the plates")
    return "; ".join(parts) + "."


def handover_line(values: Mapping[str, Any]) -> str:
    """Return a sentence on the forces of a handover; empty: the trial has none. values: content of trial.json."""
    one = values["handover"]
    if one is None:
        return ""

    def shown(key: str, unit: str) -> str:
        return "not known" if one[key] is None else f"{one[key]:.3g} {unit}"

    return (
        f"Handover in {one['duration']:.3g} s: both hold the object for {shown('overlap', 's')} (grip force above "
        f"{GRIPPED:g} N); largest interaction force meanwhile {shown('force_max', 'N')}; largest grip force of the "
        f"giver {shown('grip_giver', 'N')}, of the taker {shown('grip_taker', 'N')}. The joint moments are without "
        "these forces on the hands: how the object is turned is not in the files."
    )


def lumbar_line(values: Mapping[str, Any]) -> str:
    """Return a sentence on the compression of the lumbar spine; values: content of trial.json."""
    load = values["lumbar"]
    if load is None:
        return f"L5/S1 compression is not known; it needs the moment of {WAIST} and every angle on which that depends."
    peak, low, high = (f"{1e-3 * load[key]:.1f}" for key in ("compression", "low", "high"))
    hands = values["moments"]["hands"] or "no load in the hands"
    return (
        f"L5/S1 compression with {hands}: peak {peak} kN ({low} to {high}), at the worse end {load['level']}; known in "
        f"{_percent(load['known'])} of the time."
    )


def subject_line(values: Mapping[str, Any]) -> str:
    """Return a sentence on the subject, with the source of each number; values: content of trial.json."""
    subject, sources = values["subject"], values["sources"]
    measures = f"{subject['mass']:g} kg", f"{subject['height']:.3g} m", subject["sex"]
    return "Subject: " + ", ".join(
        f"{text} ({sources[key]})" for text, key in zip(measures, ("mass", "height", "sex"), strict=True)
    )


def render(name: str, values: Mapping[str, Any]) -> str:
    """Return the summary of a trial for the terminal.

    Args:
        name: name of the file, with the prefix of the person's labels.
        values: content of trial.json.
    """
    lines = [
        f"{name}: {values['marker_set']}, {len(values['markers'])} markers, {values['frames']} frames at "
        f"{values['rate']:g} Hz",
        fit_line(values),
        known_line(values),
        moment_line(values),
        lumbar_line(values),
        *filter(None, [handover_line(values)]),
        subject_line(values),
        *(f"- {joint}: {one['reason']}" for joint, one in values["joints"].items() if one["reason"]),
        *(
            f"- {joint}: {one['rms']:.1f} deg RMS from {one['angle']} in the file; mean {one['offset']:+.1f} deg, "
            f"{one['varying']:.1f} deg RMS without it"
            for joint, one in values["vendor"].items()
        ),
        *(f"- {line}" for line in emg.lines(values)),
        *(f"- {note}" for note in (*values["notes"], *(values["moments"] or {"notes": ()})["notes"])),
    ]
    return "\n".join(lines)


HEAD = ("trial", "marker set", "markers", "frames", "fitted", "median residual", "noise", "known joints")
UNITS = ("", "", "1", "1", "%", "mm", "mm", "1")


def table_cells(name: str, values: Mapping[str, Any]) -> list[str]:
    """Return the row of a trial in the table of several trials, in the order of HEAD."""
    known = len(values["joints"]) - len(values["unknown"])
    return [
        name,
        values["marker_set"],
        str(len(values["markers"])),
        str(values["frames"]),
        f"{100.0 * values['fitted']:.0f}",
        f"{1e3 * values['residual']['median']:.1f}",
        f"{1e3 * values['noise']:.1f}",
        f"{known} of {len(values['joints'])}",
    ]


def render_table(rows: Sequence[Sequence[str]]) -> str:
    """Return the text table of several trials; rows: from `table_cells`."""
    return "\n".join(text.rows([list(HEAD), list(UNITS), *map(list, rows)], head=2))
