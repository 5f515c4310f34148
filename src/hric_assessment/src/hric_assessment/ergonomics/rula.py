"""RULA: a score from 1 to 7 of the load on arm, neck, trunk and legs; McAtamney & Corlett, Appl. Ergon. 24:91, 1993.

    scores = rula.score(Posture(upper_arm_flexion=..., elbow_flexion=...), Task(load=1.5))
    scores.score, scores.reasons(0), scores.assumptions

The values are in config/tables/rula.yaml, table A in the two versions that are in use.
"""

from collections.abc import Mapping

import numpy as np

from hric_assessment.ergonomics.posture import Task
from hric_assessment.ergonomics.scoring import IntArray, PostureMethod, Scorer, cells, index
from hric_assessment.tables import PostureTable, RulaTable, rula_table

VERSIONS = ("current", "older")
"""Names of the versions of RULA's table A; the first is the default."""


class Rula(PostureMethod):
    """RULA score of one arm and the rest of the person."""

    table = staticmethod(rula_table)
    task_fields = ("load", "static", "shock", "held", "repeats", "rest_held", "rest_repeats")
    versions = VERSIONS
    by_table = True
    legs = "the balance of RULA"

    def name(self, version: str) -> str:
        """Return title and edition of the table, and version and mark of table A, for findings."""
        table = rula_table()
        return f"{table.name}, table A {version} ({table.mark if version == VERSIONS[0] else table.older_mark})"

    def total(self, scorer: Scorer, task: Task, version: str) -> IntArray:
        """Return the RULA score, shape (n,): the cells of table C."""
        table = rula_table()
        arm = [scorer.part(name) for name in ("upper_arm", "lower_arm", "wrist", "wrist_twist")]
        rest = [scorer.part(name) for name in ("neck", "trunk", "legs")]
        load = _load(scorer, table)
        arm_added, rest_added = _muscle_use(scorer, table, "") + load, _muscle_use(scorer, table, "rest_") + load
        a = cells(table_a(table, version), index(arm[:2], (6, 3)), index(arm[2:], (4, 2)))
        b = cells(table.table_b, rest[0], index(rest[1:], (6, 2)))
        total = cells(table.table_c, a + arm_added, b + rest_added)
        scorer.parts.update(table_a=a, table_b=b, score=total)
        return total


score = Rula().score
"""Function that returns RULA's scores over time, see `PostureMethod.score`."""


def table_a(table: RulaTable, version: str) -> Mapping[str, tuple[int, ...]]:
    """Return the rows of RULA's table A in one of its VERSIONS."""
    return {**table.table_a, **(table.older_rows if version == VERSIONS[1] else {})}


def _muscle_use(scorer: Scorer, table: PostureTable, group: str) -> IntArray:
    """Return the muscle use points of the arm (group "") or of neck, trunk and legs (group "rest_"), shape (n,)."""
    held, repeats = scorer.known[f"{group}held"], scorer.known[f"{group}repeats"]
    reason = f"held for more than {table.static_time:g} s, or {table.repeats:g} times a minute or more"
    label = "muscle use, neck and trunk" if group else "muscle use"
    return scorer.flagged(label, 1, reason, (held > table.static_time) | (repeats >= table.repeats))


def _load(scorer: Scorer, table: PostureTable) -> IntArray:
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
