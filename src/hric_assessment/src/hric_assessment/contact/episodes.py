"""Contact force over time, split into a transient and a quasi-static part.

An episode lasts from the first touch to the last and includes short separations. Contact after the first half second is
quasi-static. The force is not filtered. Split, gap and rate, with their sources, are in config/tables/episodes.yaml.
"""

from dataclasses import dataclass

import numpy as np

from hric_assessment.tables import EpisodeTable
from hric_control.sim.contact_info import KINDS, UNKNOWN
from hric_core.geometry import FloatArray

PENALTY = "penalty"
"""The only kind of contact with a physically meaningful force (`hric_control.plant.Contact`)."""
STAMP = 1e-9
"""Largest difference of equal times: stamps are whole nanoseconds [s]."""
RATE_TOLERANCE = 1e-3
"""Largest shortfall of a rate from the required one: stamps are rounded [1]."""


@dataclass(frozen=True)
class Stretch:
    """Part of an episode.

    Attributes:
        begin, end: robot time [s].
        peak: largest force [N].
        peak_time: robot time of the largest force [s].
        impulse: time integral of the force [N s].
    """

    begin: float
    end: float
    peak: float
    peak_time: float
    impulse: float

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.end - self.begin


@dataclass(frozen=True)
class Episode:
    """Contact from its first touch to its last.

    Attributes:
        whole: the complete episode.
        transient: its first part.
        quasi_static: the part after the transient; None: there is none.
        rate: sampling rate [Hz].
        notes: how the episode was split.
    """

    whole: Stretch
    transient: Stretch
    quasi_static: Stretch | None
    rate: float
    notes: tuple[str, ...]


def refusal(kind: str) -> str:
    """Return why the force of a contact that is not a penalty contact is not assessed."""
    if kind == UNKNOWN:
        return "whether the force is one of a spring is not recorded"
    if kind not in KINDS:
        return f"contacts of kind {kind!r} are not known"
    return f"the force of a {kind} contact is a number of the integrator, not of the collision"


def episode(time: FloatArray, force: FloatArray, table: EpisodeTable, rate: float) -> Episode:
    """Split one episode into its transient and quasi-static parts.

    Args:
        time: ascending, from the first touch to the last, shape (n,) [s].
        force: normal force, shape (n,) [N].
        table: splitting rules.
        rate: sampling rate [Hz].
    """
    late = int(np.searchsorted(time - time[0], table["transient_time"] + STAMP))
    return Episode(
        _stretch(time, force),
        _stretch(time[:late], force[:late]),
        _stretch(time[late:], force[late:]) if late < len(time) else None,
        rate,
        _notes(rate, table),
    )


def _notes(rate: float, table: EpisodeTable) -> tuple[str, ...]:
    split, gap, needed = (table.values[name] for name in ("transient_time", "gap", "rate"))
    notes = [
        f"transient: the first {split.value:g} s ({table.mark_of(split)}), quasi-static: what lasts longer; contacts "
        f"closer than {gap.value:g} s ({table.mark_of(gap)}) are one; no filter; {rate:.0f} samples a second"
    ]
    if rate < needed.value * (1.0 - RATE_TOLERANCE):
        notes.append(f"a peak needs {needed.value:g} samples a second: higher ones may be between these")
    return tuple(notes)


def _stretch(time: FloatArray, force: FloatArray) -> Stretch:
    peak = int(np.argmax(force))
    impulse = float(np.trapezoid(force, time))
    return Stretch(float(time[0]), float(time[-1]), float(force[peak]), float(time[peak]), impulse)
