"""The force of a contact over time, cut into episodes, and each into a transient and a quasi-static part.

    for episode in episodes(time, force):
        episode.transient.peak, episode.quasi_static, episode.impulse

An episode is from the first touch to the last, with short partings within it. What lasts beyond the first half second
is quasi-static. The force is taken as it is, without a filter, and at the instants given. Split, gap and rate, with
their marks, are in config/tables/episodes.yaml.
"""

from dataclasses import dataclass

import numpy as np

from hric_assessment.findings import NotAssessableError
from hric_assessment.tables import EpisodeTable, episode_table
from hric_control.errors import HricError
from hric_control.geometry import FloatArray
from hric_control.sim.contact_info import KINDS, UNKNOWN

PENALTY = "penalty"
"""The only kind of contact whose force is one (`hric_control.plant.Contact`)."""
STAMP = 1e-9
"""Times closer than this are the same: stamps are whole nanoseconds [s]."""
RATE_TOLERANCE = 1e-3
"""By how much a rate may be below the one that is needed: stamps are rounded [1]."""


@dataclass(frozen=True)
class Stretch:
    """A part of an episode.

    Attributes:
        begin, end: robot time [s].
        peak: largest force [N].
        peak_time: robot time of it [s].
        impulse: [N s].
    """

    begin: float
    end: float
    peak: float
    peak_time: float
    impulse: float

    @property
    def duration(self) -> float:
        """[s]."""
        return self.end - self.begin


@dataclass(frozen=True)
class Episode:
    """A contact from its first touch to its last.

    Attributes:
        whole: all of it.
        transient: its beginning.
        quasi_static: what lasts longer; None: nothing does.
        work: that the contact did on the person until it had pressed most [J]; None: the speed is not known.
        rate: of the samples [Hz].
        notes: how it was made.
    """

    whole: Stretch
    transient: Stretch
    quasi_static: Stretch | None
    work: float | None
    rate: float
    notes: tuple[str, ...]


def episodes(
    time: FloatArray,
    force: FloatArray,
    closing: FloatArray | None = None,
    kind: str = PENALTY,
    table: EpisodeTable | None = None,
) -> list[Episode]:
    """All episodes of one pair of bodies.

    Args:
        time: ascending, shape (n,) [s]; a contact that has begun before the first counts from there.
        force: normal force, shape (n,) [N].
        closing: speed along the normal at which both come towards each other, shape (n,) [m/s].
        kind: of contact.
        table: by default the one that comes with the package.

    Raises:
        NotAssessableError: the force is one between rigid surfaces, or nothing is known of its kind.
        HricError: arrays of other shapes, times that do not ascend, a force that is not finite.
    """
    if kind != PENALTY:
        raise NotAssessableError(f"{refusal(kind)}; valid: {PENALTY} contact")
    table = table or episode_table()
    _check(time, force, closing)
    touching = np.flatnonzero(force > table["touch_force"])
    cuts = np.flatnonzero(np.diff(time[touching]) > table["gap"] + STAMP) + 1
    rate = float(1.0 / np.median(np.diff(time))) if len(time) > 1 else 0.0
    found = []
    for group in np.split(touching, cuts):
        if len(group):
            part = slice(group[0], group[-1] + 1)
            found.append(episode(time[part], force[part], table, rate, None if closing is None else closing[part]))
    return found


def refusal(kind: str) -> str:
    """Return why the force of another kind of contact is not assessed."""
    if kind == UNKNOWN:
        return "whether the force is one of a spring is not recorded"
    if kind not in KINDS:
        return f"contacts of kind {kind!r} are not known"
    return f"the force of a {kind} contact is a number of the integrator, not of the collision"


def episode(
    time: FloatArray, force: FloatArray, table: EpisodeTable, rate: float, closing: FloatArray | None = None
) -> Episode:
    """Cut one episode into its parts; arguments as those of `episodes`, rate: of the samples [Hz]."""
    late = int(np.searchsorted(time - time[0], table["transient_time"] + STAMP))
    work = None if closing is None else float(max(0.0, _running(time, force * closing).max()))
    return Episode(
        _stretch(time, force),
        _stretch(time[:late], force[:late]),
        _stretch(time[late:], force[late:]) if late < len(time) else None,
        work,
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


def _running(time: FloatArray, values: FloatArray) -> FloatArray:
    """Integral from the first instant to each, shape (n,)."""
    steps = 0.5 * np.diff(time) * (values[1:] + values[:-1])
    return np.concatenate([[0.0], np.cumsum(steps)])


def _check(time: FloatArray, force: FloatArray, closing: FloatArray | None) -> None:
    for name, values in (("force", force), ("closing", closing)):
        if values is not None and np.shape(values) != np.shape(time):
            raise HricError(f"{name} has the shape {np.shape(values)}; valid: that of time, {np.shape(time)}")
        if values is not None and not np.all(np.isfinite(values)):
            at = time[np.flatnonzero(~np.isfinite(values))[0]]
            raise HricError(f"{name} is not finite at {at:.3f} s; valid: finite numbers")
    if not np.all(np.diff(time) > 0.0):
        at = time[np.flatnonzero(~(np.diff(time) > 0.0))[0]]
        raise HricError(f"time does not ascend after {at:.3f} s; valid: ascending times")
