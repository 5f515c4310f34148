"""Episodes of contact with one body region: the force over time, from the recorded contacts, and the doubts about it.

    for episode in episodes(contacts, source_period=1e-3, recorded_until=9.0):
        episode.transient, episode.contacts, episode.doubts, episode.unknown_peak

An episode lasts from the first touch to the last and includes short separations. Contact after the first half second is
quasi-static. The force is not filtered. Split, gap and rate, with their sources, are in config/tables/episodes.yaml.

Forces of several links of one model on one region are added where they overlap in time; of several models the larger
force counts, since a wall behind the person presses back. The start and duration stated in the messages count, not the
stamps of the messages: a clamping with throttled or lost messages stays one clamping. A force that is NaN, negative or
infinite is invalid.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hric_assessment.findings import BoolArray, unknown
from hric_assessment.tables import ValueTable, episode_table, verdict_table
from hric_control.sim.contact_info import KINDS, UNKNOWN
from hric_core.geometry import FloatArray
from hric_human.contact import RegionContact

PENALTY = "penalty"
"""The only kind of contact with a physically meaningful force (`hric_control.plant.Contact`)."""
STAMP = 1e-9
"""Largest difference of equal times: stamps are whole nanoseconds [s]."""
RATE_TOLERANCE = 1e-3
"""Largest shortfall of a rate from the required one: stamps are rounded [1]."""
SAME_INSTANT = 1e-4
"""Largest difference of instants of a contact that count as one [s] (project default): no source exceeds 10 kHz."""
CLOCKS = 0.02
"""Largest difference of a message's stamp from the time of its stated start and duration [s] (project default)."""
FLAT, SLOPE, QUANTA = 3, 0.01, 3.0
"""Criterion of a flat top, as of a saturated sensor (project defaults).

Minimum number of equal samples in a row, and the steepness of the flanks, as a fraction of the force per sample [1] and
in smallest sensor steps. A force that settles approaches its final value slowly, and that of a coarse sensor step by
step.
"""
NOISE, COARSEST, SMOOTHEST = 0.02, 0.05, 2.0
"""Tolerances of a flat top (project defaults, unconfirmed).

Its samples differ by at most NOISE [N] (0.01 N on either side) or by one sensor step of at most COARSEST times the
force [1]. The flanks are so steep that a smooth peak, a parabola, would differ SMOOTHEST times more [1].
"""
OFF_BEAT = 2
"""Number of contact instants between messages that prove a source faster than its messages (project default)."""
Samples = tuple[RegionContact, FloatArray, FloatArray, BoolArray]
"""Contact, with its ascending times [s], its forces [N] and True for each usable sample, shape (n,) each."""


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
        overall: the complete episode; its peak is NaN if no sample is usable.
        transient: its first part.
        quasi_static: the part after the transient; None: there is none.
        rate: sampling rate [Hz].
        notes: how the episode was split.
        contacts: recorded contacts that form the episode.
        doubts: reasons why it cannot be called harmless, a clause each; empty: none.
        unknown_peak: upper bound of the quasi-static force where samples are missing [N]; None: no sample is missing.
    """

    overall: Stretch
    transient: Stretch
    quasi_static: Stretch | None = None
    rate: float = math.nan
    notes: tuple[str, ...] = ()
    contacts: tuple[RegionContact, ...] = ()
    doubts: tuple[str, ...] = ()
    unknown_peak: float | None = None

    @property
    def known(self) -> bool:
        """True if the force has a usable sample."""
        return math.isfinite(self.overall.peak)


def refusal(kind: str) -> str:
    """Return why the force of a contact that is not a penalty contact is not assessed."""
    if kind == UNKNOWN:
        return "the recording does not say if the force is that of a spring"
    if kind not in KINDS:
        return f"contacts of kind {kind!r} are not known"
    return f"the force of a {kind} contact is a number of the integrator, not of the collision"


def split(time: FloatArray, force: FloatArray, table: ValueTable, rate: float) -> Episode:
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


def _notes(rate: float, table: ValueTable) -> tuple[str, ...]:
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


def end_of(contact: RegionContact) -> float:
    """Return the end of a contact, or the time of its last message, robot time [s]."""
    duration = contact.duration if np.isfinite(contact.duration) else 0.0
    times = contact.series.time[np.isfinite(contact.series.time)]
    return float(max(contact.begin + duration, times.max(initial=-np.inf)))


def window_of(contacts: Sequence[RegionContact]) -> tuple[float, float]:
    """Return start and end of some contacts, robot time [s]."""
    return min(contact.begin for contact in contacts), max(map(end_of, contacts))


def episodes(
    contacts: Sequence[RegionContact],
    source_period: float,
    recorded_until: float,
    table: ValueTable | None = None,
) -> list[Episode]:
    """Cut penalty contacts into episodes.

    Args:
        contacts: contacts of one body region of a person.
        source_period: time between two evaluations of the force [s]; infinite: not known.
        recorded_until: robot time of the last message of the topic [s].
        table: splitting rules; by default the table of the package.
    """
    if not contacts:
        return []
    table = table or episode_table()
    largest = max(map(_largest, contacts))
    groups: list[list[RegionContact]] = []
    until = -np.inf
    for contact in sorted(contacts, key=lambda contact: contact.begin):
        if not contact.begin <= until + table["gap"] + STAMP:
            groups.append([])
        groups[-1].append(contact)
        until = max(until, end_of(contact))
    return [_episode(group, source_period, recorded_until, table, largest) for group in groups]


def resolved(contact: RegionContact, period: float) -> bool:
    """Return True if the source of a contact evaluates its force at least once in a period [s].

    Either its messages are that frequent, or OFF_BEAT of the instants that they state (start, end, times of peaks) lie
    between messages and all instants are whole periods apart, as for a source that evaluates 1000 times a second and
    publishes 200 messages.
    """
    time = np.unique(contact.series.time[np.isfinite(contact.series.time)])
    if not len(time):
        return False
    beat = _period(time)
    if beat <= period * (1.0 + RATE_TOLERANCE):
        return True
    stated = np.concatenate([[contact.begin, end_of(contact)], contact.series.reached_time])
    off_beat = [instant for instant in np.sort(stated[np.isfinite(stated)]) if _off(instant - time[0], beat)]
    if any(_off(instant - time[0], period) for instant in (*time, *off_beat)):
        return False
    return 1 + int((np.diff(off_beat) > SAME_INSTANT).sum()) >= OFF_BEAT


def _period(time: FloatArray) -> float:
    """Return the median time between ascending instants [s]; infinite for a single instant."""
    return float(np.median(np.diff(time).tolist() or [np.inf]))


def _off(offset: float, period: float) -> bool:
    """Return True if an offset is not a whole number of periods [s]; of an infinite period only 0 is."""
    return abs(math.remainder(offset, period)) > SAME_INSTANT


def _largest(contact: RegionContact) -> float:
    """Return the largest force that the messages of a contact state [N]."""
    reached = contact.series.reached
    return float(reached[np.isfinite(reached)].max(initial=0.0))


def _episode(
    contacts: list[RegionContact], source_period: float, recorded_until: float, table: ValueTable, largest: float
) -> Episode:
    samples = [_samples(contact) for contact in contacts]
    doubts = [
        doubt for contact, time, force, _ in samples for doubt in _doubts(contact, time, force, recorded_until, largest)
    ]
    lasted = max(map(end_of, contacts)) - contacts[0].begin
    if not all(contact.ended for contact in contacts) and lasted <= table["transient_time"] + STAMP:
        doubts.append("it had not ended when the recording ended")
    needed = 1.0 / table["rate"]
    if source_period > needed * (1.0 + RATE_TOLERANCE) and not all(resolved(contact, needed) for contact in contacts):
        doubts.append(f"a blow needs {table['rate']:g} samples a second, and its messages do not show that it has them")
    unique_doubts = tuple(dict.fromkeys(doubts))
    models: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for contact, time, force, usable in samples:
        if _usable(contact).any() and usable.any():
            model = contact.other.rpartition("::")[0].partition("::")[0]  # of a nested model the outermost; "": no name
            models.setdefault(model, []).append((time[usable], force[usable]))
    if not models:
        nothing = Stretch(contacts[0].begin, max(map(end_of, contacts)), math.nan, math.nan, math.nan)
        return Episode(nothing, nothing, contacts=tuple(contacts), doubts=unique_doubts)
    times = np.unique(np.concatenate([time for pairs in models.values() for time, _ in pairs]))
    total = np.max(
        [sum(np.interp(times, *pair, left=0.0, right=0.0) for pair in pairs) for pairs in models.values()], axis=0
    )
    period = source_period if np.isfinite(source_period) else _period(times)
    episode = split(times, total, table, 1.0 / period)
    overall = replace(episode.overall, impulse=sum(contact.impulse or 0.0 for contact in contacts))
    peak = _unknown_peak(samples, episode, table)
    return replace(episode, overall=overall, contacts=tuple(contacts), doubts=unique_doubts, unknown_peak=peak)


def _usable(contact: RegionContact) -> BoolArray:
    """Return a mask of the messages of a contact that have a valid force, shape (n,)."""
    return np.isfinite(contact.series.force) & (contact.series.force >= 0.0)


def _samples(contact: RegionContact) -> Samples:
    """Return the samples of one contact, with its start and its peaks, which may lie between two messages."""
    series = contact.series
    rose = series.reached != np.concatenate([[0.0], series.reached[:-1]])  # True for NaN, too
    at = np.where(np.isfinite(series.reached_time), series.reached_time, series.time)[rose]
    at = np.clip(at, contact.begin, series.time[rose])
    touch = np.nextafter(episode_table()["touch_force"], np.inf)
    time = np.concatenate([series.time, at, [contact.begin]])
    force = np.concatenate([series.force, series.reached[rose], [touch]])
    usable = np.isfinite(time) & np.isfinite(force) & (force >= 0.0)
    order = np.lexsort((np.where(usable, -force, np.inf), time))  # at equal times the largest force is first
    time, force, usable = time[order], force[order], usable[order]
    first = np.concatenate([[True], np.diff(time) > 0.0])
    return contact, time[first], force[first], usable[first]


def _doubts(
    contact: RegionContact, time: FloatArray, force: FloatArray, recorded_until: float, largest: float
) -> list[str]:
    """Return the reasons why one contact cannot be called harmless.

    Args:
        contact: the contact.
        time: instants of its samples, shape (n,) [s].
        force: force of its samples, shape (n,) [N].
        recorded_until: robot time of the last message of the topic [s].
        largest: largest force on the region in all contacts [N]; a saturated sensor does not exceed it.
    """
    series, doubts = contact.series, list[str]()
    bad = ~(_usable(contact) & np.isfinite(series.reached) & (series.reached >= 0.0))
    if (series.force > series.reached * (1.0 + RATE_TOLERANCE)).any():
        doubts.append("a force is above the peak that its message states")
    if contact.impulse is not None and not contact.impulse >= 0.0:
        doubts.append("its impulse is not a number or below 0")
    if bad.any():
        doubts.append(f"{int(bad.sum())} of {len(bad)} forces are not numbers or below 0")
    stated = contact.begin + series.since_begin
    if not (np.abs(series.time - stated) <= CLOCKS).all() or not contact.duration >= 0.0:
        doubts.append("its messages are not of the time that begin and duration state")
    at_range = force.max() >= (1.0 - COARSEST) * largest
    if not bad.any() and at_range and _flat(contact, time[1:], force[1:]):  # without the start, which has no message
        doubts.append(f"the force has a flat top at {force.max():.1f} N, as of a sensor at its range")
    if contact.interrupted:
        doubts.append("messages in between have neither the contact nor its end, as those of a second publisher")
    end = end_of(contact)
    if not contact.ended and recorded_until - end > verdict_table()["max_gap"]:
        doubts.append(f"its end is not recorded: the last message of it is of {end:.3f} s")
    return doubts


def _flat(contact: RegionContact, time: FloatArray, force: FloatArray) -> bool:
    """Return True if the largest force forms a flat top, within sensor noise, between steep flanks.

    The top is FLAT messages long, or extends from a message to a peak that is stated for another instant.
    """
    between = np.abs(time[:, None] - contact.series.time[None, :]).min(axis=1) > SAME_INSTANT
    top, steps = float(force.max(initial=0.0)), np.abs(np.diff(force))
    quantum = float(steps[steps > 1e-9].min(initial=np.inf))
    if not (np.abs(force / quantum - np.round(force / quantum)) < 1e-6).all():
        quantum = 0.0  # the sensor has no steps
    noise = min(max(NOISE, quantum), COARSEST * top)
    edges = np.flatnonzero(np.diff(np.pad(force >= top - noise * (1.0 + 1e-6), 1)))
    slope = np.diff(np.pad(force, 2))  # a contact begins and ends without force
    for first, end in edges.reshape(-1, 2):  # rows of `force`, end exclusive
        enough = end - first >= FLAT or (end - first >= 2 and between[first:end].any())
        half = 0.5 * (end - first - 1)  # of a parabola a k^2 that changes by a (2 k + 3) before its top
        smooth = SMOOTHEST * np.ptp(force[first:end]) * (2.0 * half + 3.0) / max(half, 0.5) ** 2
        if enough and max(slope[first], -slope[end + 2]) > max(SLOPE * top, QUANTA * quantum, smooth):
            return True
    return False


def _unknown_peak(samples: Sequence[Samples], episode: Episode, table: ValueTable) -> float | None:
    """Return the upper bound of the quasi-static force in gaps longer than may be bridged, from stated peaks [N]."""
    held, max_gap = episode.overall.begin + table["transient_time"], verdict_table()["max_gap"]
    bound, any_unknown = 0.0, False
    for contact, time, _, usable in samples:
        any_unknown |= bool(unknown(time, usable, (max(held, contact.begin), end_of(contact)), max_gap))
        bound += float(contact.series.reached[np.isfinite(contact.series.reached)].max(initial=0.0))
    return bound if any_unknown else None
