"""First section of a page: assessment of safety and ergonomics of the person, from verdict.json.

Five conclusions and a picture of the worst moment come first; the evidence follows, collapsed.
"""

import base64
import io
import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import cast

import numpy as np
from markupsafe import Markup

from hric_assessment.ergonomics.scoring import PostureMethod, methods
from hric_assessment.verdict import assess, moment, opened
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE, EFFORT, POSTURE, TASK, Conclusion
from hric_assessment.verdict.inputs import FILE, AssessmentInput
from hric_assessment.verdict.result import VERSION, certainty_lines
from hric_bags import files
from hric_bags.run_folder import RunFolder
from hric_report.html import body_picture, templates
from hric_report.html.chart import Axis
from hric_report.html.strip import Strip, StripBar, time_axis
from hric_report.html.verdict_file import ActivationEntry, FindingEntry, ScoreEntry, VerdictFile

DAMAGED = LookupError, TypeError
"""Errors that reading a verdict file of another program raises."""
KINDS = {"within limits": "within", "warning": "warning", "above limits": "above", "not assessable": "unknown"}
"""CSS class (colour) of each outcome of a finding."""
REPLIES = {"yes": "within", "warning": "warning", "no": "above", "unknown": "unknown", "no limit": "plain"}
"""CSS class (colour) of each reply to a question."""
BY_DEFAULT = {
    CONTACT: "Was each contact within the limits for the person?",
    DISTANCE: "Did the arm keep its protective distance?",
    POSTURE: "Was the posture within limits?",
    EFFORT: "How high was the physical load on the person?",
    TASK: "Was the task completed?",
}
"""Full text of the question of each conclusion, by key."""
SHOWN = 200
"""Maximum number of findings in the table; further ones are only counted. Project default, unconfirmed."""
MUSCLES, INSTANTS = 24, 500
"""Maximum size of the heat map of muscle activation: rows (the most active muscles), and columns (equal time spans, of
which the peaks are shown). Project default, unconfirmed."""


def verdict_of(folder: RunFolder) -> VerdictFile | None:
    """Return the contents of a run's verdict.json; None: there was no person in the run.

    If the file is missing or outdated, the run is assessed and the file written. A current file, e.g. one that the
    command `assess` wrote with the user's options, is left unchanged.

    Raises:
        HricError: the bag cannot be read.
    """
    with suppress(*DAMAGED):
        if (known := written(folder)) is not None:
            return known
    definition = folder.read().get("definition") or {}
    if not (definition.get("human") or definition.get("person")):
        return None
    return _judge(opened(str(folder.path)))


def written(folder: RunFolder) -> VerdictFile | None:
    """Return the contents of a run's verdict.json; None: it is missing, invalid or outdated.

    Raises:
        LookupError, TypeError: it is of another program, or damaged.
    """
    return _read(folder.path / FILE, folder.path.name, "run", folder.bag_path)


def _judge(source: AssessmentInput) -> VerdictFile:
    """Assess a recording, write the verdict to its file and return its contents."""
    judged = assess(source).to_dict()
    files.write_json(source.verdict_file, judged)
    return cast(VerdictFile, judged)


def _read(path: Path, name: str, kind: str, recording: Path) -> VerdictFile | None:
    """Return the contents of a verdict file; None: it is missing, invalid, of another version or recording, or older.

    recording: file or folder of the recording; a verdict that is older than it is not about its present contents.
    """
    parts = [one.stat().st_mtime for one in (recording, *recording.rglob("*")) if one.is_file()]
    if not path.is_file() or path.stat().st_mtime < max(parts, default=0.0):
        return None
    try:
        content: VerdictFile = json.loads(path.read_text())
    except ValueError:
        return None
    about = content["version"], content["input"]["name"], content["input"]["kind"]
    return content if about == (VERSION, name, kind) else None


def verdict_of_recording(source: AssessmentInput, path: Path) -> VerdictFile:
    """Return the verdict on a bag or c3d file from the file next to it; assess it if that file does not fit."""
    recording = source.recording
    with suppress(*DAMAGED):
        known = _read(source.verdict_file, source.name, source.kind, path)
        if known is not None and (known["input"]["begin"], known["input"]["end"]) == (recording.begin, recording.end):
            return known
    return _judge(source)


def conclusions_of(verdict: VerdictFile) -> list[Conclusion]:
    """Return the conclusions in the contents of a verdict.json."""
    return [Conclusion(**entry) for entry in verdict["answers"]]


def label(verdict: VerdictFile) -> tuple[str, str]:
    """Return the label with the outcome for the top of a page, as (kind, text)."""
    return KINDS[verdict["outcome"]], f"safety and ergonomics: {verdict['outcome']}"


def summary(verdict: VerdictFile) -> str:
    """Return outcome, notes, conclusions and disclaimer of a verdict as text for the terminal."""
    notes = [f"note: {note}" for note in verdict["input"]["notes"]]
    lines = [f"verdict: {verdict['outcome']}", *notes, *map(str, conclusions_of(verdict)), verdict["disclaimer"]]
    return "\n".join(lines)


def part(verdict: VerdictFile) -> Markup:
    """Return the HTML of the page section on safety and ergonomics."""
    scene = verdict["moment"]
    sides = list({curve["side"]: None for key in methods() for curve in verdict["timelines"].get(key, ())})
    text = (
        templates.environment()
        .get_template("verdict.html")
        .render(
            verdict=verdict,
            conclusions=conclusions_of(verdict),
            certain={entry["question"]: certainty_lines(entry) for entry in verdict["certainty"]},
            questions=BY_DEFAULT,
            replies=REPLIES,
            moment=scene and Markup(moment.picture(moment.Moment.of(scene))),
            body=body_picture.picture(verdict["findings"], sides),
            strips=list(_strips(verdict, time_axis(verdict["input"]["begin"], verdict["input"]["end"]))),
            shown=SHOWN,
        )
    )
    return Markup(text)


def _strips(verdict: VerdictFile, axis: Axis) -> Iterator[Strip]:
    """Yield the charts over time: findings, posture scores, muscle activation."""
    windows = [(finding, finding["window"]) for finding in verdict["findings"] if finding["window"]]
    if windows:
        groups = list(dict.fromkeys(finding["group"] for finding, _ in windows))
        bars = [
            StripBar(*window, groups.index(finding["group"]), KINDS[finding["outcome"]], _as_text(finding))
            for finding, window in reversed(windows)  # the worst findings are drawn on top
        ]
        key = [(look, word) for word, look in KINDS.items()]
        yield Strip("findings", "Findings; a click shows the time in the replay", groups, axis, bars, key)
    for name, method in methods().items():
        if curves := verdict["timelines"].get(name):
            yield _scores(method, curves, verdict["findings"], axis)
    activation = verdict["timelines"]["activation"]
    if activation and activation["time"]:
        yield _heat(activation, axis)


def _as_text(finding: FindingEntry) -> str:
    share = "" if finding["share"] is None else f", {100.0 * finding['share']:.0f} % of the limit"
    return f"{finding['subject']}: {finding['outcome']}{share}. {finding['reason']}"


def _scores(method: PostureMethod, curves: Sequence[ScoreEntry], findings: Sequence[FindingEntry], axis: Axis) -> Strip:
    """Return the chart of a posture score's levels; a low score is "unknown" unless all joint angles are known."""
    title, levels = method.table().title, [int(highest) for highest in method.table().levels]
    lacking = [item["subject"] for item in findings if item["outcome"] == "not assessable"]
    known = [f"{title} of the {item['side']} arm" not in lacking for item in curves]
    bars = [bar for row, item in enumerate(curves) for bar in _levels(title, levels, item, row, known[row])]
    key = [(_look(levels, k), f"up to {highest}") for k, highest in enumerate(levels)]
    if not all(known):
        key.append(("unknown", "low, but the true score may be higher: not all angles are known"))
    labels = [f"{title} {item['side']}" for item in curves]
    return Strip(title, f"{title}: level of the score over time", labels, axis, bars, key)


def _look(levels: Sequence[int], level: int) -> str:
    """Return the CSS class of a level of a posture score; the highest level of each method is level4."""
    return f"level{level + 5 - len(levels)}"


def _levels(title: str, levels: Sequence[int], curve: ScoreEntry, row: int, known: bool) -> Iterator[StripBar]:
    """Yield the bars of a posture score, one for each time span with a constant level."""
    time = curve["time"]
    reached = [next(k for k, highest in enumerate(levels) if score <= highest) for score in curve["score"]]
    first = 0
    for level, group in groupby(reached):
        last = first + len(list(group))
        scores, look = curve["score"][first:last], _look(levels, level)
        text = f"{title} {min(scores)} to {max(scores)} from {time[first]:.2f} s"
        shown = look if known or look > "level1" else "unknown"
        yield StripBar(time[first], time[min(last, len(time) - 1)], row, shown, text)
        first = last


def _heat(activation: ActivationEntry, axis: Axis) -> Strip:
    """Return the heat map of muscle activation, the most active muscle first; its scale ends at a multiple of 0.1."""
    from matplotlib.image import imsave  # slow to import, and only needed with muscles

    values = np.array(activation["activation"], dtype=float)
    peaks = np.nan_to_num(values).max(axis=1)
    rows = np.argsort(-peaks, kind="stable")[:MUSCLES]
    time = np.array(activation["time"])
    edges = np.linspace(axis.low, axis.high, min(INSTANTS, len(time)) + 1)
    cells = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 2)
    image = np.full((len(rows), len(edges) - 1), np.nan)
    for k, row in enumerate(rows):
        known = np.isfinite(values[row])
        np.fmax.at(image[k], cells[known], values[row][known])
    buffer = io.BytesIO()
    top = 0.1 * max(np.ceil(10.0 * float(peaks.max()) - 1e-9), 1.0)
    imsave(buffer, image, cmap="YlOrRd", vmin=0.0, vmax=top, format="png")
    names = [str(activation["name"][row]) for row in rows]
    title = f"Muscle activation, 0 (light) to {top:.1g} (dark) of the maximum activation; estimate of a model"
    return Strip("activation", title, names, axis, image=base64.b64encode(buffer.getvalue()).decode(), row=12.0)
