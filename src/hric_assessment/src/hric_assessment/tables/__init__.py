"""Published tables, and the loader of their files.

    limits = limit_table("iso_ts_15066")        # or "bgia2011", or a Path to a user's own file
    rula_table(), reba_table(), niosh_table(), separation_table(), episode_table(), area_table(), verdict_table()

Each file in config/tables has the values in their printed units, their sources, and a mark for each value: the number
of public sources that confirm it. The tables return printed values; the users of a table convert them to SI.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TypeVar

from hric_assessment.tables.base import MARKS, AreaTable, NioshTable, TableFile, ValueTable
from hric_assessment.tables.limits import FOOT, REGIONS, ForceRow, LimitRow, LimitTable, PressureRow
from hric_assessment.tables.posture import Adder, Band, Condition, PostureTable, RebaTable, RulaTable
from hric_core.errors import check_known
from hric_core.parameters import package_yaml, read_yaml, unknown

__all__ = [
    "FOOT",
    "LIMIT_TABLES",
    "MARKS",
    "REGIONS",
    "UNITS",
    "Adder",
    "AreaTable",
    "Band",
    "Condition",
    "ForceRow",
    "LimitRow",
    "LimitTable",
    "NioshTable",
    "PostureTable",
    "PressureRow",
    "RebaTable",
    "RulaTable",
    "TableFile",
    "ValueTable",
    "area_table",
    "episode_table",
    "limit_table",
    "niosh_table",
    "reba_table",
    "rula_table",
    "separation_table",
    "verdict_table",
]
LIMIT_TABLES = ("iso_ts_15066", "bgia2011")
"""Limit tables of the package; the first is the default."""
T = TypeVar("T", bound="TableFile")
NIOSH_NAMES = (
    "load_constant",
    "horizontal",
    "horizontal_limit",
    "vertical",
    "vertical_slope",
    "vertical_limit",
    "distance_offset",
    "distance_slope",
    "distance",
    "distance_limit",
    "asymmetry_slope",
    "asymmetry_limit",
    "speed_limit",
    "design_goal",
    "high",
)
SEPARATION_NAMES = ("walking_speed", "hand_speed", "near", "intrusion_slope", "intrusion_offset", "resolution_limit")
EPISODE_NAMES = ("transient_time", "rate", "touch_force", "gap")
VERDICT_NAMES = (
    "near_limit",
    "lasting",
    "angle",
    "max_gap",
    "held",
    "lift",
    "moving",
    "reaction_time",
    "stopping_time",
    "active",
    "very_active",
    "weak_shoulder",
)
"""Values that the files must have."""
UNITS = {"force": 1.0, "pressure": 1e4, "stiffness": 1e3, "length": 1e-2}
"""SI values of the printed units N, N/cm^2, N/mm, cm."""


def limit_table(which: str | Path = LIMIT_TABLES[0]) -> LimitTable:
    """Return one of LIMIT_TABLES, or the table of a user's file.

    Raises:
        ParameterError: no such table, or an unusable file, with all its mistakes.
    """
    if isinstance(which, Path):
        return LimitTable.of(read_yaml(which), f"{which.name}:")
    if which not in LIMIT_TABLES:
        raise unknown("limits", which, [*LIMIT_TABLES, "a YAML file"], "hric_assessment")
    return _built_in(LimitTable, which)


@cache
def rula_table() -> RulaTable:
    """Return config/tables/rula.yaml."""
    return _built_in(RulaTable, "rula")


@cache
def reba_table() -> RebaTable:
    """Return config/tables/reba.yaml."""
    return _built_in(RebaTable, "reba")


@cache
def niosh_table() -> NioshTable:
    """Return config/tables/niosh.yaml."""
    return _built_in(NioshTable, "niosh", NIOSH_NAMES)


@cache
def separation_table() -> ValueTable:
    """Return config/tables/separation.yaml."""
    return _built_in(ValueTable, "separation", SEPARATION_NAMES)


@cache
def episode_table() -> ValueTable:
    """Return config/tables/episodes.yaml."""
    return _built_in(ValueTable, "episodes", EPISODE_NAMES)


@cache
def area_table() -> AreaTable:
    """Return config/tables/contact_areas.yaml."""
    return _built_in(AreaTable, "contact_areas", ("smallest",))


@cache
def verdict_table() -> ValueTable:
    """Return config/tables/verdict.yaml."""
    return _built_in(ValueTable, "verdict", VERDICT_NAMES)


def _built_in(kind: type[T], name: str, values: Sequence[str] = ()) -> T:
    """Return a table of the package; values: names of the single values that it must have."""
    table = kind.of(package_yaml(__file__, f"tables/{name}"), f"{name}.yaml:")
    check_known("value", values, getattr(table, "values", ()), f"{name}.yaml")
    return table
