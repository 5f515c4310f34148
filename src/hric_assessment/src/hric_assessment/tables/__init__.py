"""Tables of published limits and scores, read from config/tables.

    limits = limit_table("iso_ts_15066")        # or "bgia2011", or a Path to a user's own file
    rula_table(), reba_table(), niosh_table(), separation_table(), episode_table(), area_table(), verdict_table()
    uncertain_table(), lumbar_table(), ocra_table(), push_table()

Each file has the values in their printed units, their sources, and a mark for each value: how many public sources
confirm it. The tables contain printed units; code that uses a table converts them to SI.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TypeVar

from hric_assessment.tables.base import (
    MARKS,
    AreaTable,
    NioshTable,
    TableFile,
    UncertainNumber,
    UncertainTable,
    ValueTable,
)
from hric_assessment.tables.limits import FOOT, REGIONS, EnergyRow, ForceRow, LimitRow, LimitTable, PressureRow
from hric_assessment.tables.posture import Adder, Band, Condition, PostureTable, RebaTable, RulaTable
from hric_assessment.tables.tasks import OcraTable, PushRow, PushTable
from hric_core.errors import check_known
from hric_core.parameters import package_yaml, read_yaml, unknown

__all__ = [
    "AREA",
    "FOOT",
    "LIMITS",
    "LIMIT_TABLES",
    "MARKS",
    "MASS",
    "REACTION",
    "REGIONS",
    "ROTORS",
    "STIFFNESS",
    "STOPPING",
    "TIME_STEP",
    "UNITS",
    "Adder",
    "AreaTable",
    "Band",
    "Condition",
    "EnergyRow",
    "ForceRow",
    "LimitRow",
    "LimitTable",
    "NioshTable",
    "OcraTable",
    "PostureTable",
    "PressureRow",
    "PushRow",
    "PushTable",
    "RebaTable",
    "RulaTable",
    "TableFile",
    "UncertainNumber",
    "ValueTable",
    "area_table",
    "episode_table",
    "limit_table",
    "lumbar_table",
    "niosh_table",
    "ocra_table",
    "push_table",
    "reba_table",
    "rula_table",
    "separation_table",
    "uncertain_table",
    "verdict_table",
]
LIMIT_TABLES = ("iso_ts_15066", "bgia2011")
"""Names of the contact limit tables of the package; the first is the default."""
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
LUMBAR_NAMES = ("action_limit", "permissible", "lever_arm", "lever_arm_range", "height", "height_range")
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
    "grid_safety",
    "grid_order",
)
"""Names of the values that config/tables/verdict.yaml must have."""
UNCERTAIN_NAMES = ROTORS, STIFFNESS, MASS, LIMITS, AREA, REACTION, STOPPING = (
    "rotor_inertia",
    "region_stiffness",
    "body_mass",
    "unconfirmed_limits",
    "contact_area",
    "reaction_time",
    "stopping",
)
TIME_STEP = "time_step"
"""Name of the factor of the numerical error of a peak force; its range comes from a twin run."""
"""Names of the numbers that config/tables/uncertain.yaml may have."""
UNITS = {"force": 1.0, "pressure": 1e4, "stiffness": 1e3, "length": 1e-2}
"""Factors from the printed units N, N/cm^2, N/mm and cm to SI."""


def limit_table(which: str | Path = LIMIT_TABLES[0]) -> LimitTable:
    """Return a contact limit table: one of LIMIT_TABLES by its name, or that of a user's file by its path.

    Raises:
        ParameterError: there is no such table, or the file is invalid; all its mistakes are listed.
    """
    if isinstance(which, Path):
        return LimitTable.of(read_yaml(which), f"{which.name}:")
    if which not in LIMIT_TABLES:
        raise unknown("limits", which, [*LIMIT_TABLES, "a YAML file"], "hric_assessment")
    return _built_in(LimitTable, which)


@cache
def rula_table() -> RulaTable:
    """Return the table of RULA (config/tables/rula.yaml)."""
    return _built_in(RulaTable, "rula")


@cache
def reba_table() -> RebaTable:
    """Return the table of REBA (config/tables/reba.yaml)."""
    return _built_in(RebaTable, "reba")


@cache
def niosh_table() -> NioshTable:
    """Return the values of the NIOSH lifting equation (config/tables/niosh.yaml)."""
    return _built_in(NioshTable, "niosh", NIOSH_NAMES)


@cache
def lumbar_table() -> ValueTable:
    """Return the values of the compression at L5/S1 (config/tables/lumbar.yaml)."""
    return _built_in(ValueTable, "lumbar", LUMBAR_NAMES)


@cache
def ocra_table() -> OcraTable:
    """Return the table of the OCRA checklist (config/tables/ocra.yaml)."""
    return _built_in(OcraTable, "ocra")


@cache
def push_table() -> PushTable:
    """Return the forces of pushing and pulling (config/tables/pushing.yaml)."""
    return _built_in(PushTable, "pushing")


@cache
def separation_table() -> ValueTable:
    """Return the constants of the protective separation distance (config/tables/separation.yaml)."""
    return _built_in(ValueTable, "separation", SEPARATION_NAMES)


@cache
def episode_table() -> ValueTable:
    """Return the values by which contacts are divided into episodes (config/tables/episodes.yaml)."""
    return _built_in(ValueTable, "episodes", EPISODE_NAMES)


@cache
def area_table() -> AreaTable:
    """Return the possible contact areas by region (config/tables/contact_areas.yaml)."""
    return _built_in(AreaTable, "contact_areas", ("smallest",))


@cache
def verdict_table() -> ValueTable:
    """Return the thresholds of the verdict (config/tables/verdict.yaml)."""
    return _built_in(ValueTable, "verdict", VERDICT_NAMES)


@cache
def uncertain_table() -> UncertainTable:
    """Return the numbers that are not confirmed, with their ranges (config/tables/uncertain.yaml)."""
    table = _built_in(UncertainTable, "uncertain")
    check_known("number", table.numbers, UNCERTAIN_NAMES, "uncertain.yaml")
    return table


def _built_in(kind: type[T], name: str, values: Sequence[str] = ()) -> T:
    """Return a table of the package; values: names of the single values that it must have."""
    table = kind.of(package_yaml(__file__, f"tables/{name}"), f"{name}.yaml:")
    check_known("value", values, getattr(table, "values", ()), f"{name}.yaml")
    return table
