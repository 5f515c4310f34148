"""The figure and the table of moment arms beside published ones, from the built-in anatomy: moment_arms.py --write."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hric_human.muscles import Anatomy, find

ROOT = Path(__file__).parents[3]
PUBLISHED = Path(__file__).parent / "data" / "published_moment_arms.yaml"
FIGURE, PAGE = ROOT / "docs" / "moment_arms.svg", ROOT / "docs" / "concepts" / "muscle_anatomy.md"
BEGIN, END = "<!-- moment arms: moment_arms.py --write -->\n", "<!-- end of moment arms -->\n"
WIDTH, HEIGHT, LEFT, TOP, ACROSS, COLUMNS = 250, 180, 44, 30, 195, 3
"""Size of a panel, position and width of the plot in it [px], and number of panels in a row."""
DOWN = 115
"""Height of a plot [px]."""


@dataclass(frozen=True)
class Compared:
    """A muscle beside what was published.

    Attributes:
        row: row of the file of published values.
        angles: joint angles of the curve, shape (n,) [deg].
        lines: moment arms by line of action, shape (lines, n) [mm].
        mean: mean moment arm weighted by force, shape (n,) [mm].
        at: angle at which model and publication are compared [deg].
        model, published: moment arm at that angle [mm].
    """

    row: dict[str, Any]
    angles: np.ndarray
    lines: np.ndarray
    mean: np.ndarray
    at: list[float]
    model: list[float]
    published: list[float]


def compared() -> list[Compared]:
    """All rows of the file."""
    anatomy = find("delft", "anatomy")
    return [_compared(anatomy, row) for row in read()["muscles"]]


def read() -> dict[str, Any]:
    """The file of published values."""
    content: dict[str, Any] = yaml.safe_load(PUBLISHED.read_text())
    return content


def _compared(anatomy: Anatomy, row: dict[str, Any]) -> Compared:
    index = anatomy.joints.index(row["over"])
    first, last = np.round(np.degrees([anatomy.lower[index], anatomy.upper[index]]))
    angles = np.arange(first, last + 0.5)
    lines = np.array([_arms(anatomy, name, row, angles) for name in row["lines"]])
    mean = np.average(lines, axis=0, weights=[anatomy.muscles[name].max_force for name in row["lines"]])
    if "peak" in row:
        k = int(np.argmax(np.sign(row["peak"]) * mean))
        return Compared(row, angles, lines, mean, [float(angles[k])], [float(mean[k])], [row["peak"]])
    at = [float(angle) for angle in row["at"]]
    return Compared(row, angles, lines, mean, at, np.interp(at, angles, mean).tolist(), row["value"])


def _arms(anatomy: Anatomy, name: str, row: dict[str, Any], angles: np.ndarray) -> np.ndarray:
    """Return the moment arm of a line of action over angles of a joint [mm]."""
    length = anatomy.muscles[name].length
    if row["joint"] not in length.joints:
        return np.zeros(len(angles))
    posture = {**dict.fromkeys(anatomy.joints, 0.0), **row.get("posture", {})}
    q = np.array([[angle if joint == row["over"] else posture[joint] for joint in length.joints] for angle in angles])
    return -1e3 * length.gradients(np.radians(q))[:, length.joints.index(row["joint"])]


def table(rows: list[Compared]) -> str:
    """Return the comparison as a Markdown table."""
    text = [
        "| muscle | at | model mm | published mm | difference in size mm | source | status |",
        "|---|---|---|---|---|---|---|",
    ]
    sources = read()["sources"]
    for one in rows:
        row, source = one.row, sources[one.row["source"]]
        posture = "".join(f", `{joint}` {angle}" for joint, angle in row.get("posture", {}).items())
        where = "peak" if "peak" in row else ", ".join(f"{angle:.0f}" for angle in one.at)
        difference = np.sign(one.published) * np.subtract(one.model, one.published)
        cells = [
            row["name"],
            f"`{row['over']}` {where}{posture}",
            ", ".join(f"{value:.1f}" for value in one.model),
            _published(one),
            ", ".join(f"{value:+.1f}" for value in difference),
            source["text"],
            source["status"],
        ]
        text.append(f"| {' | '.join(cells)} |")
    return "\n".join(text) + "\n"


def _published(one: Compared) -> str:
    deviation = one.row.get("deviation")
    if deviation is None:
        return ", ".join(f"{value:g}" for value in one.published)
    return ", ".join(f"{value:g} +- {spread:g}" for value, spread in zip(one.published, deviation, strict=True))


def figure(rows: list[Compared]) -> str:
    """Return the comparison as an SVG figure."""
    height = HEIGHT * (-(-len(rows) // COLUMNS))
    panels = [
        f'<g transform="translate({WIDTH * (k % COLUMNS)} {HEIGHT * (k // COLUMNS)})">{_panel(one)}</g>'
        for k, one in enumerate(rows)
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH * COLUMNS}" height="{height}" viewBox="0 0 '
        f'{WIDTH * COLUMNS} {height}" font-family="sans-serif" font-size="11">\n'
        '<rect width="100%" height="100%" fill="white"/>\n' + "\n".join(panels) + "\n</svg>\n"
    )


def _panel(one: Compared) -> str:
    """A muscle: its curve, the band of its lines, published values."""
    values = [*one.lines.ravel(), *one.published, 0.0]
    step = 10.0 if np.ptp(values) < 45.0 else 20.0
    low, high = step * np.floor(min(values) / step), step * np.ceil(max(values) / step)
    first, last = float(one.angles[0]), float(one.angles[-1])

    def place(angle: float, value: float) -> tuple[float, float]:
        return LEFT + ACROSS * (angle - first) / (last - first), TOP + DOWN * (high - value) / (high - low)

    def line(angles: np.ndarray, arms: np.ndarray) -> str:
        return " ".join("{:.1f},{:.1f}".format(*place(a, v)) for a, v in zip(angles[::5], arms[::5], strict=True))

    parts = [f'<text x="{LEFT}" y="16" font-weight="bold">{one.row["name"]}, mm</text>']
    for value in np.arange(low, high + 0.5 * step, step):
        x, y = place(first, value)
        grey = "#888" if value == 0.0 else "#ddd"
        parts.append(f'<path d="M{x:.1f} {y:.1f}h{ACROSS}" stroke="{grey}"/>')
        parts.append(f'<text x="{x - 6:.1f}" y="{y + 4:.1f}" text-anchor="end">{value:.0f}</text>')
    for angle in range(int(-(-first // 30) * 30), int(last) + 1, 30):
        x, y = place(angle, low)
        parts.append(f'<text x="{x:.1f}" y="{y + 15:.1f}" text-anchor="middle">{angle}</text>')
    parts.append(f'<text x="{LEFT + ACROSS}" y="{TOP + DOWN + 28}" text-anchor="end">{one.row["over"]}, deg</text>')
    band = f"{line(one.angles, one.lines.max(axis=0))} {line(one.angles[::-1], one.lines.min(axis=0)[::-1])}"
    parts.append(f'<polygon points="{band}" fill="#9bc4e8" opacity="0.6"/>')
    parts.append(f'<polyline points="{line(one.angles, one.mean)}" fill="none" stroke="#1f5f99" stroke-width="2"/>')
    if "peak" in one.row:
        _, y = place(first, one.row["peak"])
        parts.append(f'<path d="M{LEFT} {y:.1f}h{ACROSS}" stroke="#c23b22" stroke-width="2" stroke-dasharray="6 4"/>')
    else:
        spreads = one.row.get("deviation", [0.0] * len(one.at))
        for angle, value, spread in zip(one.at, one.published, spreads, strict=True):
            x, y = place(angle, value)
            half = y - place(angle, value + spread)[1]
            parts.append(f'<path d="M{x:.1f} {y - half:.1f}v{2.0 * half:.1f}" stroke="#c23b22" stroke-width="2"/>')
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="#c23b22"/>')
    return "".join(parts)


def page(text: str, rows: list[Compared]) -> str:
    """The page with the table in its place."""
    head, _, rest = text.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return f"{head}{BEGIN}{table(rows)}{END}{tail}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", required=True, help="replace the figure and the table")
    parser.parse_args()
    made = compared()
    FIGURE.write_text(figure(made))
    PAGE.write_text(page(PAGE.read_text(), made))
