"""The first part of a page: what a run would have meant for the person in it, from its verdict.json."""

import base64
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from hric_assessment.verdict import assess, opened
from hric_assessment.verdict.command import FILE
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.result import VERSION
from hric_bags import files
from hric_bags.run_folder import RunFolder
from hric_control.errors import HricError
from hric_experiments.report import sections
from hric_experiments.report_html import body_picture
from hric_experiments.report_html.tables import Table, escape, number, render

Verdict = Mapping[str, Any]
KINDS = {"within limits": "within", "warning": "warning", "above limits": "above", "not assessable": "unknown"}
"""Outcome -> class of its colour."""
WIDTH, LEFT, ROW = 640.0, 120.0, 20.0
"""Of what lies along time: all of it, its labels, and a row [units of the picture]."""
SHOWN = 200
"""Findings in the table; more are counted. Project default, unconfirmed."""
MUSCLES, INSTANTS = 24, 500
"""Rows and columns of the heat map, at most; the most active, and the largest value of each stretch of time. Project
default, unconfirmed."""
LEVELS = {"RULA": (2, 4, 6, 7), "REBA": (1, 3, 7, 10, 15)}
"""Highest score of each level."""


@dataclass(frozen=True)
class Axis:
    """Time across a picture; begin, end: [s]."""

    begin: float
    end: float

    def x(self, time: float) -> float:
        """Where a time is [units of the picture]."""
        share = (time - self.begin) / max(self.end - self.begin, 1e-9)
        return LEFT + (WIDTH - LEFT) * min(max(share, 0.0), 1.0)

    def bar(self, begin: float, end: float, row: int, look: str, said: str) -> str:
        """A stretch of time in a row, which a click shows in the replay."""
        x = self.x(begin)
        width = max(self.x(end) - x, 3.0)
        return (
            f'<rect class="jump {look}" tabindex="0" role="button" data-time="{begin:.9g}" x="{x:.2f}" '
            f'y="{row * ROW + 3:g}" width="{width:.2f}" height="{ROW - 6:g}"><title>{escape(said)}</title></rect>'
        )

    def picture(self, name: str, labels: Sequence[str], content: str, row: float = ROW) -> str:
        """SVG with a line at the time of the replay; a click anywhere shows that time."""
        height = row * len(labels)
        words = "".join(
            f'<text x="{LEFT - 8:g}" y="{row * (k + 0.5) + 4:g}" text-anchor="end">{escape(label)}</text>'
            for k, label in enumerate(labels)
        )
        ticks = "".join(
            f'<text class="tick" x="{self.x(t):.1f}" y="{height + 14:g}" text-anchor="middle">{t:.4g}</text>'
            for t in np.linspace(self.begin, self.end, 6)[:-1]
        )
        unit = f'<text class="tick" x="{WIDTH:g}" y="{height + 14:g}" text-anchor="end">{self.end:.4g} s</text>'
        now = f'<line class="now" x1="{LEFT:g}" x2="{LEFT:g}" y1="0" y2="{height:g}"/>'
        about = f'data-left="{LEFT:g}" data-width="{WIDTH:g}" data-begin="{self.begin:.9g}" data-end="{self.end:.9g}"'
        return (
            f'<svg class="strip" data-strip="{name}" viewBox="0 0 {WIDTH:g} {height + 18:g}" {about} role="img" '
            f'aria-label="{escape(name)} over time">{words}{content}{ticks}{unit}{now}</svg>'
        )


def verdict_of(folder: RunFolder) -> dict[str, Any] | None:
    """What verdict.json of a run says; one that `assess` left, with the choices of its user, stays.

    Returns:
        None: there was no person in the run.

    Raises:
        HricError: the bag cannot be used.
    """
    path = folder.path / FILE
    if (found := _kept(path)) is not None:
        return found
    definition = folder.read().get("definition") or {}
    if not (definition.get("human") or definition.get("person")):
        return None
    made: dict[str, Any] = assess(opened(str(folder.path))).to_dict()
    files.write_json(path, made)
    return made


def _kept(path: Path) -> dict[str, Any] | None:
    """What is in a file, of today's version; None: nothing of use."""
    try:
        found: dict[str, Any] = json.loads(path.read_text()) if path.is_file() else {}
    except ValueError:
        return None
    return found if found.get("version") == VERSION else None


def verdict_beside(given: Given) -> dict[str, Any]:
    """Likewise of a bag or a c3d file, whose verdict.json is beside it; one of another recording is replaced."""
    path = given.folder / FILE
    found = _kept(path)
    if found is not None and found["input"]["name"] == given.name and found["input"]["kind"] == given.kind:
        return found
    made: dict[str, Any] = assess(given).to_dict()
    try:
        files.write_json(path, made)
    except OSError as error:
        raise HricError(f"cannot write {FILE} in {given.folder}: {error.strerror or error}") from error
    return made


def part(verdict: Verdict) -> str:
    """HTML of the part."""
    axis = Axis(float(verdict["input"]["begin"]), float(verdict["input"]["end"]))
    disclaimer = f"<p class=disclaimer>{escape(verdict['disclaimer'])}</p>"
    findings = verdict["findings"]
    outcome = verdict["outcome"]
    head = f'<p class="outcome {KINDS[outcome]}">{escape(outcome)}</p>{disclaimer}'
    limits = f"{verdict['limits']['title']} ({verdict['limits']['edition']})"
    caption = f"<figcaption>Contacts, each region by the largest share of its limit in {escape(limits)}.</figcaption>"
    body = f"<figure class=body-picture>{body_picture.picture(findings)}{caption}</figure>"
    strips = "".join(_strips(verdict, axis))
    tables = "".join(render(table) for table in _tables(verdict))
    return f"{head}<div class=verdict-top>{body}<div class=strips>{strips}</div></div>{tables}{disclaimer}"


def _strips(verdict: Verdict, axis: Axis) -> Iterator[str]:
    """What lies along time."""
    windows = [one for one in verdict["findings"] if one["window"]]
    if windows:
        groups = list(dict.fromkeys(one["group"] for one in windows))
        bars = [
            axis.bar(one["window"][0], one["window"][1], groups.index(one["group"]), KINDS[one["outcome"]], _said(one))
            for one in reversed(windows)  # the worst lie on top
        ]
        yield _figure("Findings; a click shows the time in the replay", axis.picture("findings", groups, "".join(bars)))
    for method in ("RULA", "REBA"):
        curves = verdict["timelines"][method.lower()]
        if curves:
            content = "".join(_scores(one, k, method, axis) for k, one in enumerate(curves))
            labels = [f"{method} {one['side']}" for one in curves]
            levels = ", ".join(f"up to {level}" for level in LEVELS[method])
            yield _figure(f"{method}, by its levels: {levels}", axis.picture(method, labels, content))
    activation = verdict["timelines"]["activation"]
    if activation and activation["time"]:
        yield _figure("Activation of muscles, 0 (dark) to 1 (bright); an estimate of a model", _heat(activation, axis))


def _figure(title: str, content: str) -> str:
    return f"<figure class=along><figcaption>{escape(title)}</figcaption>{content}</figure>"


def _said(one: Mapping[str, Any]) -> str:
    share = "" if one["share"] is None else f", {100.0 * one['share']:.0f} % of the limit"
    return f"{one['subject']}: {one['outcome']}{share}. {one['reason']}"


def _scores(curve: Mapping[str, Any], row: int, method: str, axis: Axis) -> str:
    """Stretches of one level."""
    time, levels = curve["time"], LEVELS[method]
    reached = [next(k for k, highest in enumerate(levels) if score <= highest) for score in curve["score"]]
    bars, first = [], 0
    for level, group in groupby(reached):
        last = first + len(list(group))
        scores = curve["score"][first:last]
        said = f"{method} {min(scores)} to {max(scores)} from {time[first]:.2f} s"
        end = time[min(last, len(time) - 1)]
        bars.append(axis.bar(time[first], end, row, f"level{level + 5 - len(levels)}", said))
        first = last
    return "".join(bars)


def _heat(activation: Mapping[str, Any], axis: Axis) -> str:
    """Muscles over time as a picture, the most active first."""
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
    imsave(buffer, image, cmap="magma", vmin=0.0, vmax=1.0, format="png")
    data = base64.b64encode(buffer.getvalue()).decode()
    names, high = [str(activation["name"][row]) for row in rows], 12.0
    drawn = (
        f'<image x="{LEFT:g}" y="0" width="{WIDTH - LEFT:g}" height="{high * len(rows):g}" preserveAspectRatio="none" '
        f'href="data:image/png;base64,{data}"/>'
    )
    return axis.picture("activation", names, drawn, high)


def _tables(verdict: Verdict) -> Iterator[Table]:
    """Findings, figures without a limit, and what is missing."""
    findings = verdict["findings"]
    shown = findings[:SHOWN]
    rows = tuple(
        (
            one["outcome"],
            one["subject"],
            "-" if one["share"] is None else f"{100.0 * one['share']:.0f} %",
            "-" if one["window"] is None else f"{one['window'][0]:.3f} to {one['window'][1]:.3f}",
            one["reason"],
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
