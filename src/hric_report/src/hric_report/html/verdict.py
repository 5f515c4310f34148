"""The first part of a page: what a run would have meant for the person in it, from its verdict.json.

Five conclusions and a picture of the worst moment come first; their evidence is folded away.
"""

import base64
import io
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from hric_assessment.verdict import assess, moment, opened
from hric_assessment.verdict.command import FILE
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE, EFFORT, POSTURE, TASK, Conclusion
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.result import VERSION
from hric_bags import files
from hric_bags.run_folder import RunFolder
from hric_report import sections
from hric_report.html import body_picture
from hric_report.html.tables import Table, escape, number, render

Verdict = Mapping[str, Any]
KINDS = {"within limits": "within", "warning": "warning", "above limits": "above", "not assessable": "unknown"}
"""Outcome -> class of its colour."""
REPLIES = {"yes": "within", "warning": "warning", "no": "above", "unknown": "unknown", "no limit": "plain"}
"""Reply -> class of its colour."""
BY_DEFAULT = {
    CONTACT: "Was each contact within what the person bears?",
    DISTANCE: "Did the arm keep its protective distance?",
    POSTURE: "Was the posture within limits?",
    EFFORT: "What did it cost the person?",
    TASK: "Was the task completed?",
}
"""Questions in words."""
WIDTH, LEFT, ROW = 640.0, 120.0, 20.0
"""Of what lies along time: all of it, its labels, and a row [units of the picture]."""
SHOWN = 200
"""Findings in the table; more are counted. Project default, unconfirmed."""
MUSCLES, INSTANTS = 24, 500
"""Rows and columns of the heat map, at most; the most active, and the largest value of each stretch of time. Project
default, unconfirmed."""
LEVELS = {"RULA": (2, 4, 6, 7), "REBA": (1, 3, 7, 10, 15)}
"""Highest score of each level."""
TICKS = 6
"""Intervals along time, at most (project default)."""


@dataclass(frozen=True)
class Axis:
    """Time across a picture, from begin to end [s]."""

    begin: float
    end: float

    def x(self, time: float) -> float:
        """Return where a time is [units of the picture]."""
        share = (time - self.begin) / max(self.end - self.begin, 1e-9)
        return LEFT + (WIDTH - LEFT) * min(max(share, 0.0), 1.0)

    @property
    def ticks(self) -> list[float]:
        """Round times along the axis [s]: multiples of 1, 2 or 5 times a power of ten."""
        span = max(self.end - self.begin, 1e-6)
        power = 10.0 ** np.floor(np.log10(span / TICKS))
        step = next(step for step in power * np.array([1.0, 2.0, 5.0, 10.0]) if span / step <= TICKS)
        return [step * k for k in range(int(np.ceil(self.begin / step - 1e-9)), int(self.end / step + 1e-9) + 1)]

    def bar(self, begin: float, end: float, row: int, look: str, said: str) -> str:
        """Return a stretch of time in a row, which a click shows in the replay."""
        x = self.x(begin)
        width = max(self.x(end) - x, 3.0)
        return (
            f'<rect class="jump {look}" tabindex="0" role="button" data-time="{begin:.9g}" x="{x:.2f}" '
            f'y="{row * ROW + 3:g}" width="{width:.2f}" height="{ROW - 6:g}"><title>{escape(said)}</title></rect>'
        )

    def picture(self, name: str, labels: Sequence[str], content: str, row: float = ROW) -> str:
        """Return an SVG with a line at the time of the replay; a click anywhere shows that time."""
        height = row * len(labels)
        words = "".join(
            f'<text x="{LEFT - 8:g}" y="{row * (k + 0.5) + 4:g}" text-anchor="end">{escape(label)}</text>'
            for k, label in enumerate(labels)
        )
        ticks = "".join(
            f'<text class="tick" x="{self.x(t):.1f}" y="{height + 14:g}" text-anchor="middle">{t:.4g}</text>'
            for t in self.ticks
            if self.x(t) < WIDTH - 60.0
        )
        unit = f'<text class="tick" x="{WIDTH:g}" y="{height + 14:g}" text-anchor="end">time [s]</text>'
        now = f'<line class="now" x1="{LEFT:g}" x2="{LEFT:g}" y1="0" y2="{height:g}"/>'
        about = f'data-left="{LEFT:g}" data-width="{WIDTH:g}" data-begin="{self.begin:.9g}" data-end="{self.end:.9g}"'
        return (
            f'<svg class="strip" data-strip="{name}" viewBox="0 0 {WIDTH:g} {height + 18:g}" {about} role="img" '
            f'aria-label="{escape(name)} over time">{words}{content}{ticks}{unit}{now}</svg>'
        )


def verdict_of(folder: RunFolder) -> dict[str, Any] | None:
    """Return what verdict.json of a run says; one that `assess` left, with the choices of its user, stays.

    Returns:
        the contents; None: there was no person in the run.

    Raises:
        HricError: the bag cannot be used.
    """
    path = folder.path / FILE
    if (kept := _kept(path, folder.path.name, "run")) is not None:
        return kept
    definition = folder.read().get("definition") or {}
    if not (definition.get("human") or definition.get("person")):
        return None
    made: dict[str, Any] = assess(opened(str(folder.path))).to_dict()
    files.write_json(path, made)
    return made


def _kept(path: Path, name: str, kind: str) -> dict[str, Any] | None:
    """Return what a file has; None: nothing of this version and of this recording."""
    try:
        kept: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {}
    except ValueError:
        return None
    own = kept.get("version") == VERSION and (kept["input"]["name"], kept["input"]["kind"]) == (name, kind)
    return kept if own else None


def verdict_beside(given: Given) -> dict[str, Any]:
    """Return the verdict of a bag or a c3d file from verdict.json beside it; one of another recording is replaced."""
    path, recording = given.folder / FILE, given.recording
    kept = _kept(path, given.name, given.kind)
    if kept is not None and (kept["input"]["begin"], kept["input"]["end"]) == (recording.begin, recording.end):
        return kept
    made: dict[str, Any] = assess(given).to_dict()
    files.write_json(path, made)
    return made


def conclusions_of(verdict: Verdict) -> list[Conclusion]:
    """Return the conclusions that a verdict.json has, without their findings."""
    return [Conclusion(**{**one, "finding": None}) for one in verdict["answers"]]


def summary(verdict: Verdict) -> str:
    """Return outcome, conclusions and disclaimer as text."""
    lines = [f"verdict: {verdict['outcome']} (verdict.json)", *map(str, conclusions_of(verdict)), verdict["disclaimer"]]
    return "\n".join(lines)


def part(verdict: Verdict) -> str:
    """Return the HTML of the part."""
    axis = Axis(float(verdict["input"]["begin"]), float(verdict["input"]["end"]))
    sides = [curve["side"] for curve in verdict["timelines"]["rula"]]
    limits = f"{verdict['limits']['title']} ({verdict['limits']['edition']})"
    caption = f"<figcaption>Contacts, each region by the largest share of its limit in {escape(limits)}.</figcaption>"
    body = f"<figure class=body-picture>{body_picture.picture(verdict['findings'], sides)}{caption}</figure>"
    strips = "".join(_strips(verdict, axis))
    tables = "".join(render(table) for table in _tables(verdict))
    return (
        f"<div class=answers-top>{_conclusions(verdict)}{_moment(verdict)}</div>"
        f"<p class=disclaimer>{escape(verdict['disclaimer'])}</p>"
        "<details><summary>Evidence: findings, body, course over time, figures, assumptions</summary>"
        f"<div class=verdict-top>{body}<div class=strips>{strips}</div></div>{tables}</details>"
    )


def _conclusions(verdict: Verdict) -> str:
    """Return the five conclusions as a table."""
    rows = []
    for one in conclusions_of(verdict):
        who = f"{one.person}: " if one.person else ""
        remedy = one.remedy
        if remedy.startswith("--"):
            remedy = f"hric assess {verdict['input']['name']} {remedy}"
        known = f"<div class=remedy>To know it: {escape(remedy)}</div>" if remedy else ""
        rows.append(
            f'<tr title="{escape(BY_DEFAULT[one.question])}"><th scope=row>{escape(one.question)}</th>'
            f'<td><span class="reply {REPLIES[one.reply]}">{escape(one.reply)}</span></td>'
            f"<td><b>{escape(one.number)}</b> {escape(who + one.subject)}"
            f"<div class=note>{escape(one.reason or BY_DEFAULT[one.question])}</div>{known}</td></tr>"
        )
    return f"<table class=answers>{''.join(rows)}</table>"


def _moment(verdict: Verdict) -> str:
    """Return the picture of the worst moment, which a click shows in the replay."""
    scene = verdict["moment"]
    if scene is None:
        return ""
    title = f"The worst moment, {scene['question']}: {scene['subject']}, at {scene['time']:.2f} s"
    jump = f'class=jump tabindex=0 role=button data-time="{scene["time"]:.9g}"'
    return f"<figure><div {jump}>{moment.picture(scene)}</div><figcaption>{escape(title)}</figcaption></figure>"


def _strips(verdict: Verdict, axis: Axis) -> Iterator[str]:
    """Yield what lies along time."""
    windows = [one for one in verdict["findings"] if one["window"]]
    if windows:
        groups = list(dict.fromkeys(one["group"] for one in windows))
        bars = [
            axis.bar(one["window"][0], one["window"][1], groups.index(one["group"]), KINDS[one["outcome"]], _said(one))
            for one in reversed(windows)  # the worst lie on top
        ]
        drawn = axis.picture("findings", groups, "".join(bars))
        yield _figure(
            "Findings; a click shows the time in the replay", drawn + _key((look, word) for word, look in KINDS.items())
        )
    for method in ("RULA", "REBA"):
        curves = verdict["timelines"][method.lower()]
        if curves:
            lacking = [one["subject"] for one in verdict["findings"] if one["outcome"] == "not assessable"]
            known = [f"{method} of the {one['side']} arm" not in lacking for one in curves]
            content = "".join(_scores(one, k, method, axis, known[k]) for k, one in enumerate(curves))
            labels = [f"{method} {one['side']}" for one in curves]
            levels = LEVELS[method]
            key = _key((f"level{k + 5 - len(levels)}", f"up to {highest}") for k, highest in enumerate(levels))
            key += "" if all(known) else _key([("unknown", "low, but it can only be higher: not all angles are known")])
            yield _figure(f"{method}, by the levels of its score", axis.picture(method, labels, content) + key)
    activation = verdict["timelines"]["activation"]
    if activation and activation["time"]:
        yield _heat(activation, axis)


def _figure(title: str, content: str) -> str:
    return f"<figure class=along><figcaption>{escape(title)}</figcaption>{content}</figure>"


def _key(colours: Iterable[tuple[str, str]]) -> str:
    """Return the key of a picture; colours: (class of the colour, what it means)."""
    marks = (
        f'<span><svg viewBox="0 0 9 9"><rect class="{look}" width="9" height="9"/></svg>{escape(word)}</span>'
        for look, word in colours
    )
    return f"<p class=key>{''.join(marks)}</p>"


def _said(one: Mapping[str, Any]) -> str:
    share = "" if one["share"] is None else f", {100.0 * one['share']:.0f} % of the limit"
    return f"{one['subject']}: {one['outcome']}{share}. {one['reason']}"


def _scores(curve: Mapping[str, Any], row: int, method: str, axis: Axis, known: bool) -> str:
    """Return the stretches of one level; known: all angles are, so that a low score is within limits."""
    time, levels = curve["time"], LEVELS[method]
    reached = [next(k for k, highest in enumerate(levels) if score <= highest) for score in curve["score"]]
    bars, first = [], 0
    for level, group in groupby(reached):
        last = first + len(list(group))
        scores = curve["score"][first:last]
        said = f"{method} {min(scores)} to {max(scores)} from {time[first]:.2f} s"
        end = time[min(last, len(time) - 1)]
        look = f"level{level + 5 - len(levels)}"
        bars.append(axis.bar(time[first], end, row, look if known or look > "level1" else "unknown", said))
        first = last
    return "".join(bars)


def _heat(activation: Mapping[str, Any], axis: Axis) -> str:
    """Return muscles over time as a figure, the most active first, on a scale that ends at the next tenth."""
    from matplotlib.image import imsave  # slow to load, which a page without muscles need not wait for

    values = np.array(activation["activation"], dtype=float)
    peaks = np.nan_to_num(values).max(axis=1)
    rows = np.argsort(-peaks, kind="stable")[:MUSCLES]
    time = np.array(activation["time"])
    edges = np.linspace(axis.begin, axis.end, min(INSTANTS, len(time)) + 1)
    cells = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 2)
    image = np.full((len(rows), len(edges) - 1), np.nan)
    for k, row in enumerate(rows):
        known = np.isfinite(values[row])
        np.fmax.at(image[k], cells[known], values[row][known])
    buffer = io.BytesIO()
    top = 0.1 * max(np.ceil(10.0 * float(peaks.max()) - 1e-9), 1.0)
    imsave(buffer, image, cmap="YlOrRd", vmin=0.0, vmax=top, format="png")
    data = base64.b64encode(buffer.getvalue()).decode()
    names, high = [str(activation["name"][row]) for row in rows], 12.0
    drawn = (
        f'<image x="{LEFT:g}" y="0" width="{WIDTH - LEFT:g}" height="{high * len(rows):g}" preserveAspectRatio="none" '
        f'href="data:image/png;base64,{data}"/>'
    )
    title = f"Activation of muscles, 0 (light) to {top:.1g} (dark) of the largest; an estimate of a model"
    return _figure(title, axis.picture("activation", names, drawn, high))


def _tables(verdict: Verdict) -> Iterator[Table]:
    """Yield findings, figures without a limit, and what is missing."""
    findings = verdict["findings"]
    shown = findings[:SHOWN]
    rows = tuple(
        (
            one["outcome"],
            one["subject"],
            "-" if one["share"] is None else f"{100.0 * one['share']:.0f} %",
            "-" if one["window"] is None else f"{one['window'][0]:.3f} to {one['window'][1]:.3f}",
            one["reason"] + (f"; to know it: {one['remedy']}" if one["remedy"] else ""),
            one["table"],
        )
        for one in shown
    )
    left = len(findings) - len(shown)
    note = f"From the worst on; {left} more are in verdict.json." if left else "From the worst on."
    times = tuple(one["window"][0] if one["window"] else verdict["input"]["begin"] for one in shown)
    head = ("outcome", "of", "share of the limit", "time [s]", "why", "held against")
    yield Table("Findings", head, rows, note, times=times, section=sections.VERDICT)
    basis = tuple(
        (one["subject"], "; ".join(f"{name} {number(value)}" for name, value in one["values"].items()),
         ", ".join(one["signals"]), "; ".join(one["notes"]))
        for one in shown
    )  # fmt: skip
    yield Table("What the findings stand on", ("of", "values", "signals", "notes"), basis, folded=True)
    figures = tuple(
        (one["group"], one["name"], f"{number(one['value'])} {one['unit']}", one["note"]) for one in verdict["figures"]
    )
    if figures:
        yield Table("Figures without a limit", ("of", "what", "value", "how"), figures, folded=True)
    if verdict["assumptions"]:
        yield Table("Assumed of the person", ("what",), tuple((one,) for one in verdict["assumptions"]), folded=True)
    if verdict["missing"]:
        lacking = tuple((one["signal"], one["gives"]) for one in verdict["missing"])
        yield Table("Missing signals", ("signal", "would give"), lacking, folded=True)
