"""Revised NIOSH lifting equation: recommended weight limit and lifting index at origin or destination of a lift.

    rated = niosh.rate(Lift(phase="pick-up", load=12.0, horizontal=0.4, vertical=0.3, distance=0.7))
    rated.limit, rated.index, rated.multipliers

    RWL = LC HM VM DM AM FM CM,   LI = L / RWL

NIOSH Publication 94-110 (public domain). It applies to lifts with both hands by a standing person. If human and robot
carry a load together, only picking it up and putting it down can be rated, with the human's share of the load; all else
is refused. The values are in config/tables/niosh.yaml.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hric_assessment.findings import NotAssessableError
from hric_assessment.tables import UNITS, NioshTable, niosh_table
from hric_core.errors import HricError

PHASES = ("pick-up", "put-down")
"""Ends of a lift that can be rated."""
POSITIONS = ("standing",)
HOUR = 3600.0


@dataclass(frozen=True)
class Lift:
    """One end of a lift: its origin or its destination.

    Attributes:
        phase: one of PHASES.
        load: mass that the person carries; for a shared load the measured share [kg].
        horizontal: distance of the hands from the middle of the ankles [m].
        vertical: height of the hands above the floor [m].
        distance: travel of the load up or down [m].
        asymmetry: angle of the load out of the sagittal plane [rad].
        frequency: lifts per minute [1/min].
        duration: duration of the work [s].
        coupling: coupling of the hands with the load: good, fair, poor.
        hands: number of hands that lift.
        position: position of the person, one of POSITIONS.
        stable: False for a load that shifts, such as a liquid.
        speed: largest vertical speed [m/s]; None: not known, assumed to be within the scope.
    """

    phase: str
    load: float
    horizontal: float
    vertical: float
    distance: float
    asymmetry: float = 0.0
    frequency: float = 0.2
    duration: float = HOUR
    coupling: str = "good"
    hands: int = 2
    position: str = "standing"
    stable: bool = True
    speed: float | None = None


class Multipliers(NamedTuple):
    """Multipliers of the load constant in the NIOSH lifting equation [1]."""

    horizontal: float
    vertical: float
    distance: float
    asymmetry: float
    frequency: float
    coupling: float


@dataclass(frozen=True)
class LiftRating:
    """Rating of a lift by the NIOSH lifting equation.

    Attributes:
        multipliers: multipliers at full precision.
        limit: recommended weight limit [kg].
        index: lifting index [1]; infinite if the limit is 0.
        level: level of the index, in words.
        rounded_limit, rounded_index: limit [kg] and index [1] from multipliers rounded to two decimals, as in the
            worksheets of NIOSH's manual.
        assumptions: one sentence for each value that was not known.
    """

    multipliers: Multipliers
    limit: float
    index: float
    level: str
    rounded_limit: float
    rounded_index: float
    assumptions: tuple[str, ...]


def rate(lift: Lift, table: NioshTable | None = None) -> LiftRating:
    """Return the rating of a lift within the scope of the equation.

    Args:
        lift: one end of a lift.
        table: values of the equation; by default those of the package.

    Raises:
        NotAssessableError: the lift is outside the scope of the equation; one line for each reason.
        HricError: a value is impossible for a lift.
    """
    table = table or niosh_table()
    _check(lift, table)
    multipliers = multipliers_of(lift, table)
    limit = table["load_constant"] * math.prod(multipliers)
    rounded = table["load_constant"] * math.prod(rounded_multiplier(value) for value in multipliers)
    assumptions = (f"speed is not known: assumed up to {table['speed_limit']:g} m/s",) * (lift.speed is None)
    index = _index(lift.load, limit)
    level = level_of(index, table)
    return LiftRating(multipliers, limit, index, level, rounded, _index(lift.load, rounded), assumptions)


def rounded_multiplier(multiplier: float) -> float:
    """Round a multiplier to two decimals, halves up as by hand (0.745 to 0.75)."""
    return math.floor(100.0 * multiplier + 0.5 + 1e-9) / 100.0


def level_of(index: float, table: NioshTable | None = None) -> str:
    """Return the level of a lifting index, in words."""
    table = table or niosh_table()
    goal, high = table["design_goal"], table["high"]
    if index <= goal:
        return f"up to the design goal of {goal:g}"
    return "above the design goal" if index <= high else "high"


def _index(load: float, limit: float) -> float:
    return load / limit if limit > 0.0 else math.inf


def multipliers_of(lift: Lift, table: NioshTable) -> Multipliers:
    """Return the six multipliers of a lift [1]."""
    h, v, d = (length / UNITS["length"] for length in (lift.horizontal, lift.vertical, lift.distance))
    low = v < table["vertical"]
    degrees = math.degrees(lift.asymmetry)
    slope, offset = table["distance_slope"], table["distance_offset"]
    return Multipliers(
        0.0 if h > table["horizontal_limit"] else table["horizontal"] / max(h, table["horizontal"]),
        0.0 if v > table["vertical_limit"] else 1.0 - table["vertical_slope"] * abs(v - table["vertical"]),
        0.0 if d > table["distance_limit"] else 1.0 if d <= table["distance"] else offset + slope / d,
        0.0 if degrees > table["asymmetry_limit"] else 1.0 - table["asymmetry_slope"] * degrees,
        frequency_multiplier(lift.frequency, lift.duration, low, table),
        table.couplings[lift.coupling][0 if low else 1],
    )


def frequency_multiplier(frequency: float, duration: float, low: bool, table: NioshTable) -> float:
    """Return the frequency multiplier FM [1], linear between the rows of the table.

    Args:
        frequency: lifts per minute [1/min].
        duration: duration of the work [s].
        low: True if the hands are below the height (0.75 m) at which the table's columns change.
        table: values of the equation.
    """
    rows = np.array(table.frequencies)
    column = 1 + 2 * int(np.searchsorted(table.durations, duration / HOUR)) + (0 if low else 1)
    return float(np.interp(frequency, rows[:, 0], rows[:, column], right=0.0))


def _check(lift: Lift, table: NioshTable) -> None:
    if lift.coupling not in table.couplings:
        raise HricError(f"no coupling {lift.coupling!r}; valid: {', '.join(table.couplings)}")
    for name in ("load", "horizontal", "vertical", "distance", "asymmetry", "frequency", "duration"):
        value = getattr(lift, name)
        if not (math.isfinite(value) and value >= 0.0):
            raise HricError(f"the {name} of a lift is {value}; valid: a finite number of 0 or more")
    hours, speed = table.durations[-1], table["speed_limit"]
    refusals = [
        f"{name} is {value}; valid: {valid}"
        for name, value, valid, within in (
            (
                "phase",
                lift.phase,
                f"{', '.join(PHASES)} (carrying, pushing, pulling cannot be rated)",
                lift.phase in PHASES,
            ),
            ("hands", lift.hands, "2", lift.hands == 2),
            ("position", lift.position, ", ".join(POSITIONS), lift.position in POSITIONS),
            ("stable", lift.stable, "a load that does not shift", lift.stable),
            ("duration", f"{lift.duration / HOUR:g} h", f"up to {hours:g} h", lift.duration <= hours * HOUR),
            ("speed", lift.speed, f"up to {speed:g} m/s", lift.speed is None or abs(lift.speed) <= speed),
        )
        if not within
    ]
    if refusals:
        raise NotAssessableError(f"outside the scope of the {table.title}: " + "\n".join(refusals))
