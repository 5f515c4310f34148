"""Forces of pushing and pulling that 90 % of men accept, by Snook and Ciriello (ISO 11228-2, method 1).

    accepted = limits("push", (0.9, 1.0), distance=7.5, interval=60.0)
    accepted.initial, accepted.sustained           # [N]

Values are not interpolated: the row is that of the next longer distance and the next shorter interval, and of the two
nearest heights of the hands the one with the lower force. The values are in config/tables/pushing.yaml.
"""

from typing import NamedTuple

from hric_assessment.findings import NotAssessableError
from hric_assessment.tables import UNITS, PushRow, PushTable, push_table

KILOGRAM_FORCE = 9.80665
"""Force of a kilogram under standard gravity [N]."""


class PushLimits(NamedTuple):
    """Accepted forces that set an object in motion and that keep it in motion [N]."""

    initial: float
    sustained: float


def limits(
    action: str, heights: tuple[float, float], distance: float, interval: float, table: PushTable | None = None
) -> PushLimits:
    """Return the accepted forces.

    Args:
        action: push or pull.
        heights: lower and upper end of the height of the hands [m].
        distance: distance of pushing or pulling [m].
        interval: time from one action to the next [s].
        table: table of forces; by default that of the package.

    Raises:
        NotAssessableError: the height, distance or interval is outside the table.
    """
    table = table or push_table()
    column = _column(table, distance, interval)
    rows = sorted(table.push if action == "push" else table.pull, key=lambda row: row.height)
    chosen = _around(rows, heights)
    initial, sustained = (min(getattr(row, kind)[column] for row in chosen) for kind in ("initial", "sustained"))
    return PushLimits(initial * KILOGRAM_FORCE, sustained * KILOGRAM_FORCE)


def _around(rows: list[PushRow], heights: tuple[float, float]) -> list[PushRow]:
    """Return the rows from the next lower to the next higher one of an interval of heights [m]."""
    low, high = (height / UNITS["length"] for height in heights)
    if not rows[0].height <= low <= high <= rows[-1].height:
        ends = f"{rows[0].height:g} to {rows[-1].height:g} cm"
        raise NotAssessableError(f"the hands are {low:.0f} to {high:.0f} cm high; the table has {ends}")
    first = max(index for index, row in enumerate(rows) if row.height <= low)
    last = min(index for index, row in enumerate(rows) if row.height >= high)
    return rows[first : last + 1]


def _column(table: PushTable, distance: float, interval: float) -> int:
    before = 0
    for group in table.columns:
        if distance <= group.distance:
            if interval < group.intervals[0]:
                raise NotAssessableError(
                    f"one action every {interval:g} s over {distance:g} m is outside of the table: at most one every "
                    f"{group.intervals[0]:g} s"
                )
            return before + max(index for index, value in enumerate(group.intervals) if value <= interval)
        before += len(group.intervals)
    raise NotAssessableError(f"the distance is {distance:g} m; the table has up to {table.columns[-1].distance:g} m")
