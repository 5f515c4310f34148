"""RULA: a score from 1 to 7 of the load on arm, neck, trunk and legs; McAtamney & Corlett, Appl. Ergon. 24:91, 1993.

    scores = rula.score(Posture(upper_arm_flexion=..., elbow_flexion=...), Task(load=1.5))
    scores.score, scores.reasons(0), scores.assumptions

The values are in config/tables/rula.yaml, table A in two versions.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from hric_assessment.ergonomics.posture import NOTHING_KNOWN, Known, Posture, Task
from hric_assessment.ergonomics.scoring import IntArray, Scorer, Scores, cells, index, needed, scored
from hric_assessment.tables import RulaTable, rula_table
from hric_core.errors import UnknownNameError

VERSIONS = ("current", "older")
"""Versions of table A; the first is the default."""
Rows = Mapping[str, tuple[int, ...]]


def table_a(table: RulaTable, version: str) -> Rows:
    """Return the rows of table A. Raises UnknownNameError: no such version."""
    if version not in VERSIONS:
        raise UnknownNameError("version of RULA's table A", version, VERSIONS)
    return {**table.table_a, **(table.older_rows if version == VERSIONS[1] else {})}


def score(
    posture: Posture,
    task: Task = NOTHING_KNOWN,
    version: str = VERSIONS[0],
    table: RulaTable | None = None,
    spread: Mapping[str, float] = MappingProxyType({}),
) -> Scores:
    """Return the scores over time.

    Args:
        posture: one arm and the rest of the person.
        task: task of that arm; its load counts for the rest of the person, too.
        version: version of table A, one of VERSIONS.
        table: scoring table; by default that of the package.
        spread: half-widths of the intervals in which angles lie [rad], by name; inf: not known.

    Raises:
        HricError: fields of different lengths, or no such version.
    """
    table = table or rula_table()
    rows = table_a(table, version)
    fields = ("load", "static", "shock", "held", "repeats", "rest_held", "rest_repeats")
    known = Known(posture, task, [*needed(table), *fields], spread)
    mark = table.mark if version == VERSIONS[0] else table.older_mark
    method = f"{table.name}, table A {version} ({mark})"
    return scored(table, method, known, lambda scorer: _total(scorer, table, rows))


def _total(scorer: Scorer, table: RulaTable, rows_a: Rows) -> IntArray:
    arm = [scorer.part(name) for name in ("upper_arm", "lower_arm", "wrist", "wrist_twist")]
    rest = [scorer.part(name) for name in ("neck", "trunk", "legs")]
    load = _load(scorer, table)
    arm_added, rest_added = _muscle_use(scorer, table, "") + load, _muscle_use(scorer, table, "rest_") + load
    a = cells(rows_a, index(arm[:2], (6, 3)), index(arm[2:], (4, 2)))
    b = cells(table.table_b, rest[0], index(rest[1:], (6, 2)))
    total = cells(table.table_c, a + arm_added, b + rest_added)
    scorer.parts.update(table_a=a, table_b=b, score=total)
    return total


def _muscle_use(scorer: Scorer, table: RulaTable, group: str) -> IntArray:
    """Return the points of the arm (group "") or of neck, trunk and legs ("rest_")."""
    held, repeats = scorer.known[f"{group}held"], scorer.known[f"{group}repeats"]
    reason = f"held for more than {table.static_time:g} s, or {table.repeats:g} times a minute or more"
    label = "muscle use, neck and trunk" if group else "muscle use"
    return scorer.flagged(label, 1, reason, (held > table.static_time) | (repeats >= table.repeats))


def _load(scorer: Scorer, table: RulaTable) -> IntArray:
    known, light, heavy = scorer.known, table.light, table.heavy
    load = known["load"]
    size = np.where(load > heavy, 2, np.where(load >= light, 1, 0))
    case = np.where(known["shock"], 5, np.where(known["static"] & (size > 0), size + 2, size))
    reasons = (
        f"load below {light:g} kg",
        f"intermittent load of {light:g} to {heavy:g} kg",
        f"intermittent load above {heavy:g} kg",
        f"static or repeated load of {light:g} to {heavy:g} kg",
        f"static or repeated load above {heavy:g} kg",
        "load with a shock",
    )
    return scorer.cases("load", (0, 1, 2, 2, 3, 3), reasons, case)
