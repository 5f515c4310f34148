"""REBA: a score from 1 to 15 of the load on the entire body; Hignett & McAtamney, Appl. Ergon. 31:201, 2000.

    scores = reba.score(Posture(trunk_flexion=..., knee_flexion=...), Task(load=6.0, coupling="fair"))
    scores.score, scores.reasons(0), scores.level(0)

The values are in config/tables/reba.yaml.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from hric_assessment.ergonomics.posture import NOTHING_KNOWN, Known, Posture, Task
from hric_assessment.ergonomics.scoring import IntArray, Scorer, Scores, cells, index, needed, scored
from hric_assessment.tables import RebaTable, reba_table
from hric_core.errors import UnknownNameError


def score(
    posture: Posture,
    task: Task = NOTHING_KNOWN,
    table: RebaTable | None = None,
    spread: Mapping[str, float] = MappingProxyType({}),
) -> Scores:
    """Return the scores over time.

    Args:
        posture: one arm and the rest of the person.
        task: task of that arm; an unknown coupling counts as good.
        table: scoring table; by default that of the package.
        spread: half-widths of the intervals in which angles lie [rad], by name; inf: not known.

    Raises:
        HricError: fields of different lengths, or no such coupling.
    """
    table = table or reba_table()
    if task.coupling is not None and task.coupling not in table.couplings:
        raise UnknownNameError("coupling", task.coupling, table.couplings, table.title)
    fields = ("load", "shock", "held", "repeats", "rest_held", "rest_repeats", "rapid")
    known = Known(posture, task, [*needed(table), *fields], spread)
    return scored(table, table.name, known, lambda scorer: _total(scorer, table, task.coupling))


def _total(scorer: Scorer, table: RebaTable, coupling: str | None) -> IntArray:
    neck, trunk, legs = (scorer.part(name) for name in ("neck", "trunk", "legs"))
    upper, lower, wrist = (scorer.part(name) for name in ("upper_arm", "lower_arm", "wrist"))
    a = cells(table.table_a, neck, index((trunk, legs), (5, 4)))
    b = cells(table.table_b, upper, index((lower, wrist), (2, 3)))
    c = cells(table.table_c, a + _load(scorer, table), b + _coupling(scorer, table, coupling))
    total = c + _activity(scorer, table)
    scorer.parts.update(table_a=a, table_b=b, table_c=c, score=total)
    return total


def _load(scorer: Scorer, table: RebaTable) -> IntArray:
    load, light, heavy = scorer.known["load"], table.light, table.heavy
    reasons = (f"load below {light:g} kg", f"load of {light:g} to {heavy:g} kg", f"load above {heavy:g} kg")
    size = np.where(load > heavy, 2, np.where(load >= light, 1, 0))
    shock = scorer.flagged("load", 1, "load with a shock", scorer.known["shock"])
    return scorer.cases("load", (0, 1, 2), reasons, size) + shock


def _coupling(scorer: Scorer, table: RebaTable, coupling: str | None) -> IntArray:
    if coupling is None:
        scorer.known.assume(f"coupling is not known: taken as {table.couplings[0]}")
    points = table.couplings.index(coupling or table.couplings[0])
    reasons = [f"{name} coupling" for name in table.couplings]
    case = np.full(scorer.known.count, points)
    return scorer.cases("coupling", range(len(reasons)), reasons, case)


def _activity(scorer: Scorer, table: RebaTable) -> IntArray:
    known, held, repeats = scorer.known, f"{table.static_time:g} s", f"{table.repeats:g} times a minute"
    longest, often = (np.maximum(known[name], known[f"rest_{name}"]) for name in ("held", "repeats"))
    points = scorer.flagged("activity", 1, f"held for more than {held}", longest > table.static_time)
    points = points + scorer.flagged("activity", 1, f"more than {repeats}", often > table.repeats)
    return points + scorer.flagged("activity", 1, "rapid large changes or an unstable base", known["rapid"])
