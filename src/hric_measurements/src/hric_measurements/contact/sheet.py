"""Sheet of a virtual measurement as PDF, with blank columns and lines for the measurement of a test house."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from hric_assessment.contact.limits import TRANSIENT_TIME
from hric_assessment.contact.measured import MeasuredQuantity
from hric_assessment.findings import DISCLAIMER
from hric_bags import files
from hric_core.geometry import FloatArray
from hric_report import style
from hric_report.drawing import INCH, STYLE

PAGE = (210.0, 297.0)
"""Size of the page, A4 [mm]."""
EDITIONS = (
    "Limits: {limits}. Method: after public descriptions of ISO/PAS 5672:2023.\n"
    "The texts of the standards were not opened; no source confirms a difference between the editions in these values."
)
BLANK = ("test house", "date and place", "device, serial number, calibration", "operator", "signature")
"""Lines that the test house fills in."""
HEAD = ("quantity", "simulated", "limit", "simulated against limit", "measured", "measured against limit")


def write(
    path: Path,
    title: str,
    facts: Mapping[str, str],
    rows: Sequence[MeasuredQuantity],
    curves: Mapping[str, tuple[FloatArray, FloatArray]],
    limits: str,
) -> None:
    """Write the sheet.

    Args:
        path: PDF file.
        title: title of the sheet.
        facts: description of contact and device by name.
        rows: quantities with their limits.
        curves: force curves by name: times, shape (n,) [s], and forces, shape (n,) [N].
        limits: title and edition of the table of limits.
    """
    with plt.rc_context({**STYLE, "pdf.fonttype": 42}):
        page = plt.figure(figsize=(PAGE[0] / INCH, PAGE[1] / INCH))
        page.text(0.08, 0.95, title, fontsize=style.TYPE + 4.0, fontweight="bold")
        page.text(
            0.08,
            0.915,
            f"{DISCLAIMER}\n{EDITIONS.format(limits=limits)}",
            fontsize=style.TYPE - 1.0,
            va="top",
            wrap=True,
        )
        for k, (name, fact) in enumerate(facts.items()):
            page.text(0.08, 0.87 - 0.018 * k, name, va="top")
            page.text(0.34, 0.87 - 0.018 * k, textwrap.fill(fact, 85), va="top")
        _table(page.add_axes((0.08, 0.42, 0.86, 0.2)), rows)
        _curves(page.add_axes((0.12, 0.2, 0.8, 0.17)), curves)
        for k, name in enumerate(BLANK):
            page.text(0.08, 0.135 - 0.022 * k, f"{name}: {'.' * 90}")
        with files.atomic(path) as temporary:
            page.savefig(
                temporary, format="pdf", metadata={"Title": title, "Subject": DISCLAIMER, "CreationDate": None}
            )
        plt.close(page)


def _table(ax: Axes, rows: Sequence[MeasuredQuantity]) -> None:
    ax.set_axis_off()
    cells = [[row.name, _text(row.value), _text(row.limit), row.result, "", ""] for row in rows]
    table = ax.table(
        cells, colLabels=list(HEAD), loc="upper center", cellLoc="left", colWidths=[0.28, 0.11, 0.11, 0.19, 0.12, 0.19]
    )
    table.auto_set_font_size(False)
    table.set_fontsize(style.TYPE - 1.5)
    notes = "\n".join(f"{row.name}: {row.note}" for row in rows if row.note)
    ax.text(0.0, 0.5, notes, fontsize=style.TYPE - 1.5, va="top", transform=ax.transAxes)


def _text(value: float | None) -> str:
    return "not known" if value is None else f"{value:.3g}"


def _curves(ax: Axes, curves: Mapping[str, tuple[FloatArray, FloatArray]]) -> None:
    for (name, (time, force)), role in zip(curves.items(), ("raw", "measured"), strict=False):
        ax.plot(time, force, color=style.ROLES[role].light, label=name)
    if max(float(time[-1]) for time, _ in curves.values()) > TRANSIENT_TIME:
        ax.axvline(TRANSIENT_TIME, color="0.5", linewidth=0.6)
    ax.set_xlabel("time since the first touch [s]")
    ax.set_ylabel("force [N]")
    ax.legend()
