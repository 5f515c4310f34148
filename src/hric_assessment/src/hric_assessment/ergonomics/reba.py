"""REBA: a score from 1 to 15 of the load on the entire body; Hignett & McAtamney, Appl. Ergon. 31:201, 2000.

    scores = reba.score(Posture(trunk_flexion=..., knee_flexion=...), Task(load=6.0, coupling="fair"))
    scores.score, scores.reasons(0), scores.level(0)

The values are in config/tables/reba.yaml.
"""

import numpy as np

from hric_assessment.ergonomics.posture import Task
from hric_assessment.ergonomics.scoring import IntArray, PostureMethod, Scorer, cells, index
from hric_assessment.tables import RebaTable, reba_table
from hric_core.errors import check_known


class Reba(PostureMethod):
    """REBA score of one arm and the rest of the person; an unknown coupling of the hand counts as good."""

    table = staticmethod(reba_table)
    task_fields = ("load", "shock", "held", "repeats", "rest_held", "rest_repeats", "rapid")
    parts = "whole_body"
    supplements = True
    by_table = True
    legs = "REBA, which counts bent knees"

    def total(self, scorer: Scorer, task: Task, version: str) -> IntArray:
        """Return the REBA score, shape (n,): the cells of table C plus the activity score."""
        table = reba_table()
        check_known("coupling", filter(None, [task.coupling]), table.couplings, table.title)
        neck, trunk, legs = (scorer.part(name) for name in ("neck", "trunk", "legs"))
        upper, lower, wrist = (scorer.part(name) for name in ("upper_arm", "lower_arm", "wrist"))
        a = cells(table.table_a, neck, index((trunk, legs), (5, 4)))
        b = cells(table.table_b, upper, index((lower, wrist), (2, 3)))
        c = cells(table.table_c, a + _load(scorer, table), b + _coupling(scorer, table, task.coupling))
        total = c + _activity(scorer, table)
        scorer.parts.update(table_a=a, table_b=b, table_c=c, score=total)
        return total


score = Reba().score
"""Function that returns REBA's scores over time, see `PostureMethod.score`."""


def _load(scorer: Scorer, table: RebaTable) -> IntArray:
    load, light, heavy = scorer.known["load"], table.light, table.heavy
    reasons = (f"load below {light:g} kg", f"load of {light:g} to {heavy:g} kg", f"load above {heavy:g} kg")
    size = np.where(load > heavy, 2, np.where(load >= light, 1, 0))
    shock = scorer.flagged("load", 1, "load with a shock", scorer.known["shock"])
    return scorer.cases("load", (0, 1, 2), reasons, size) + shock


def _coupling(scorer: Scorer, table: RebaTable, coupling: str | None) -> IntArray:
    if coupling is None:
        scorer.known.assume(f"coupling is not known: assumed {table.couplings[0]}")
    points = table.couplings.index(coupling or table.couplings[0])
    reasons = [f"{name} coupling" for name in table.couplings]
    return scorer.cases("coupling", range(len(reasons)), reasons, np.full(scorer.known.count, points))


def _activity(scorer: Scorer, table: RebaTable) -> IntArray:
    known, held, repeats = scorer.known, f"{table.static_time:g} s", f"{table.repeats:g} times a minute"
    longest, often = (np.maximum(known[name], known[f"rest_{name}"]) for name in ("held", "repeats"))
    points = scorer.flagged("activity", 1, f"held for more than {held}", longest > table.static_time)
    points = points + scorer.flagged("activity", 1, f"more than {repeats}", often > table.repeats)
    return points + scorer.flagged("activity", 1, "rapid large changes or an unstable base", known["rapid"])
