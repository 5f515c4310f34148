"""OCRA checklist of one arm in repetitive work: a screening of the upper limbs, part of the method of ISO 11228-3.

    rated = rate(task.options, actions, shares, minutes)
    rated.score.low, .high, .worst                 # ends of its interval, and with the worst unknown values

    score = (recovery + frequency + force + posture + additional + pace) duration

Frequency is the larger score of dynamic and static actions, force the sum of its three levels, and posture the largest
of shoulder, elbow, wrist and grip plus that of identical gestures. The values are in config/tables/ocra.yaml.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hric_assessment.tables import OcraTable, ocra_table
from hric_core.geometry import FloatArray

FORCES = ("moderate_force", "strong_force", "maximal_force")
DURATION, ACTIONS = "minutes", "actions"


class Ends(NamedTuple):
    """Interval of a value by what was measured (low, high), and its upper end with what is not known at its worst."""

    low: float
    high: float
    worst: float


@dataclass(frozen=True)
class OcraRating:
    """Score of the OCRA checklist of one arm: its ends, its parts at the upper end, and what is not known."""

    score: Ends
    parts: Mapping[str, float]
    unknown: tuple[str, ...]


def rate(
    options: Mapping[str, str | None],
    actions: Ends | None,
    shares: Mapping[str, Ends],
    minutes: float | None,
    table: OcraTable | None = None,
) -> OcraRating:
    """Return the score of one arm.

    Args:
        options: stated option of each factor; None: not known.
        actions: technical actions per minute; None: not known.
        shares: shares of the time [1] with the upper arm at shoulder height (`shoulder`) and slightly raised
            (`raised`), with wide movements of the elbow (`elbow`), and with a bent wrist (`wrist`).
        minutes: net duration of the repetitive work in a shift [min]; None: not known.
        table: table of the checklist; by default that of the package.
    """
    table = table or ocra_table()
    score = {name: _factor(table, name, option) for name, option in options.items()}
    score |= {name: _by_share(table.others, shares[name]) for name in ("elbow", "wrist")}
    raised = table["raised"] * (np.array(shares["raised"]) > 0.5)
    score["shoulder"] = np.maximum(_by_share(table.shoulder, shares["shoulder"]), raised)
    frequency = np.maximum(_frequency(table, actions), score["static_hold"])
    positions = np.max([score[name] for name in ("shoulder", "elbow", "wrist", "grip")], axis=0)
    parts = {
        "recovery": score["recovery"],
        "frequency": frequency,
        "force": np.sum([score[name] for name in FORCES], axis=0),
        "posture": positions + score["same_gestures"],
        "additional": score["additional"] + score["pace"],
    }
    factors = np.array([row[1] for row in table.durations])
    known_factor = next((factor for longest, factor in table.durations if (minutes or 0.0) <= longest), 0.0)
    parts["duration"] = _unknown(factors) if minutes is None else np.full(3, known_factor)
    total = parts["duration"] * np.sum([value for name, value in parts.items() if name != "duration"], axis=0)
    known = {DURATION: minutes, ACTIONS: actions, **options}
    unknown = tuple(name for name, value in known.items() if value is None)
    return OcraRating(Ends(*total.tolist()), {name: float(value[1]) for name, value in parts.items()}, unknown)


def _unknown(scores: FloatArray) -> FloatArray:
    """Return the ends of a value that may be any of the scores."""
    return np.array([scores.min(), scores.min(), scores.max()])


def _factor(table: OcraTable, name: str, option: str | None) -> FloatArray:
    scores = table.factors[name]
    return _unknown(np.array(list(scores.values()))) if option is None else np.full(3, scores[option])


def _by_share(rows: Sequence[Sequence[float]], share: Ends) -> FloatArray:
    bounds, scores = np.array([[0.0, 0.0], *rows]).T
    return np.asarray(scores[np.searchsorted(bounds, np.array(share) + 1e-9, side="right") - 1])


def _frequency(table: OcraTable, actions: Ends | None) -> FloatArray:
    """Return the score by the actions per minute; it is not known whether interruptions are frequent."""
    rows = np.array(table.frequencies)
    if actions is None:
        return _unknown(rows[:, 2])
    at = np.minimum(np.searchsorted(rows[:, 0], np.array(actions) - 1e-9), len(rows) - 1)
    return np.array([rows[at[0], 1], rows[at[1], 2], rows[at[2], 2]])
