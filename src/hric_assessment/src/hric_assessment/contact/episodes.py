"""Contact episodes of one body region: the force over time from the recorded contacts, and the doubts about it.

    for episode in episodes(contacts, source_period=1e-3, recorded_until=9.0):
        episode.transient, episode.contacts, episode.doubts, episode.unknown_peak

An episode lasts from the first touch to the last and includes short separations. Contact after the first half second is
quasi-static. The force is not filtered. These times, and the required sample rate, are in config/tables/episodes.yaml
with their sources.

Forces of several links of one model on one region are added where they overlap in time. Of several models the larger
force counts, since a wall behind the person presses back with an equal force. Begin and end of a contact are taken from
the contents of the messages, not from their stamps, so a clamping with throttled or lost messages stays one clamping. A
force that is NaN, negative or infinite is invalid.
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
"""Kind of contact between elastic surfaces, the only one whose force is physically meaningful."""
STAMP = 1e-9
"""Maximum difference of times that count as equal [s]; stamps are whole nanoseconds."""
RATE_TOLERANCE = 1e-3
"""Relative tolerance when a rate is compared with the required one [1], since stamps are rounded."""
SAME_INSTANT = 1e-4
"""Maximum difference of instants of a contact that count as one [s] (project default): no source exceeds 10 kHz."""
CLOCKS = 0.02
"""Maximum difference between a message's stamp and its stated begin plus duration [s] (project default)."""
FLAT, SLOPE, QUANTA = 3, 0.01, 3.0
"""Criteria by which a flat top of the force, as from a saturated sensor, is recognised (project defaults).

FLAT: minimum number of equal samples in a row. SLOPE, QUANTA: minimum change of the force per sample on the flanks, as
a fraction of the force [1], and in sensor resolutions [1]. They exclude a force that settles, which approaches its
final value slowly, and with a coarse sensor in single steps.
"""
NOISE, COARSEST, SMOOTHEST = 0.02, 0.05, 2.0
"""Tolerances by which a flat top of the force is recognised (project defaults, unconfirmed).

Samples of the top differ by at most NOISE [N], or by one sensor step of at most COARSEST times the force [1]. The
flanks are so steep that the samples of a smooth peak (a parabola) would differ by SMOOTHEST times more [1].
"""
OFF_BEAT = 2
"""Minimum number of contact instants between messages; they show that the source is faster than its messages.

Project default.
"""
UNEQUAL = 1.5
"""Smallest ratio of the largest to the smallest step of a force that the sensor's resolution does not explain [1].

Project default.
"""
Samples = tuple[RegionContact, FloatArray, FloatArray, BoolArray]
"""Contact, with its ascending times [s], its forces [N] and True for each usable sample, shape (n,) each."""


@dataclass(frozen=True)
class Stretch:
    """Time interval of a contact episode, with the peak force and the impulse in it.

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
        """Duration of the interval [s]."""
        return self.end - self.begin


@dataclass(frozen=True)
class Episode:
    """Contact episode: contact with one body region from the first touch to the last.

    Attributes:
        overall: the complete episode; its peak is NaN if no sample is usable.
        transient: first half second of the episode.
        quasi_static: part after the transient; None: there is none.
        rate: sampling rate of the force [Hz].
        notes: sentences about how the episode was split into parts.
        contacts: recorded contacts that form the episode.
        doubts: reasons why the episode cannot be called within limits, a clause each; empty: none.
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
    """Return the reason why the force of a contact that is not of kind "penalty" is not assessed."""
    if kind == UNKNOWN:
        return "the recording does not state whether the contact is elastic or rigid"
    if kind not in KINDS:
        return f"contacts of kind {kind!r} are not known"
    return f"the force of a {kind} contact depends on the integration step, not on the collision"


def split(time: FloatArray, force: FloatArray, table: ValueTable, rate: float) -> Episode:
    """Split one episode into its transient and quasi-static parts.

    Args:
        time: ascending times from the first touch to the last, shape (n,) [s].
        force: normal force, shape (n,) [N].
        table: values of config/tables/episodes.yaml, such as the transient time.
        rate: sampling rate of the force [Hz].
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
        f"transient: the first {split.value:g} s ({table.mark_of(split)}), quasi-static: the time after them; contacts "
        f"less than {gap.value:g} s apart ({table.mark_of(gap)}) count as one; the force is not filtered; "
        f"{rate:.0f} samples per second"
    ]
    if rate < needed.value * (1.0 - RATE_TOLERANCE):
        notes.append(f"less than {needed.value:g} samples per second: higher peaks may lie between the samples")
    return tuple(notes)


def _stretch(time: FloatArray, force: FloatArray) -> Stretch:
    peak = int(np.argmax(force))
    impulse = float(np.trapezoid(force, time))
    return Stretch(float(time[0]), float(time[-1]), float(force[peak]), float(time[peak]), impulse)


def end_of(contact: RegionContact) -> float:
    """Return the robot time at which a contact ended, or of its last message if that is later [s]."""
    duration = contact.duration if np.isfinite(contact.duration) else 0.0
    times = contact.series.time[np.isfinite(contact.series.time)]
    return float(max(contact.begin + duration, times.max(initial=-np.inf)))


def window_of(contacts: Sequence[RegionContact]) -> tuple[float, float]:
    """Return the earliest begin and the latest end of some contacts, robot time [s]."""
    return min(contact.begin for contact in contacts), max(map(end_of, contacts))


def episodes(
    contacts: Sequence[RegionContact],
    source_period: float,
    recorded_until: float,
    table: ValueTable | None = None,
) -> list[Episode]:
    """Group the penalty contacts of a body region into episodes.

    Args:
        contacts: contacts of one body region of a person.
        source_period: time between two evaluations of the force by the simulation or sensor [s]; infinite: not known.
        recorded_until: robot time of the last message of the topic [s].
        table: values such as the longest separation within an episode; None: config/tables/episodes.yaml.
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
    """Return True if the source of a contact evaluates the force at least once in a period [s].

    Either the messages are that frequent, or at least OFF_BEAT of the instants that they state (begin, end, times of
    peaks) lie between messages, and all are whole periods apart: then the source evaluates the force more often than it
    publishes, for instance 1000 times per second with 200 messages.
    """
    time = np.unique(contact.series.time[np.isfinite(contact.series.time)])
    if not len(time):
        return False
    beat = _period(time)
    if repetitions(contact.series.force) * beat > period * (1.0 + RATE_TOLERANCE) >= beat:
        return False
    if beat <= period * (1.0 + RATE_TOLERANCE):
        return True
    stated = np.concatenate([[contact.begin, end_of(contact)], contact.series.reached_time])
    off_beat = [instant for instant in np.sort(stated[np.isfinite(stated)]) if _off(instant - time[0], beat)]
    if any(_off(instant - time[0], period) for instant in (*time, *off_beat)):
        return False
    return 1 + int((np.diff(off_beat) > SAME_INSTANT).sum()) >= OFF_BEAT


def repetitions(force: FloatArray) -> int:
    """Return how often each sample is repeated: 1, or more if the sensor is slower than its messages.

    Steps of equal size do not count: a sensor with a coarse resolution shows them when the force changes slowly.
    """
    steps = np.abs(np.diff(force))
    at = np.flatnonzero(steps > 0.0)
    return 1 if len(at) < 2 or steps[at].max() < UNEQUAL * steps[at].min() else int(np.diff(at).min())


def _period(time: FloatArray) -> float:
    """Return the median time between ascending instants [s]; infinite for a single instant."""
    return float(np.median(np.diff(time).tolist() or [np.inf]))


def _off(offset: float, period: float) -> bool:
    """Return True if an offset [s] is not a whole number of periods [s]."""
    return abs(math.remainder(offset, period)) > SAME_INSTANT


def _nearest(time: FloatArray, instants: FloatArray) -> FloatArray:
    """Return the finite instant nearest to each time, shape (n,) [s]; infinite if there is none."""
    known = np.concatenate([[-np.inf], np.unique(instants[np.isfinite(instants)]), [np.inf]])
    after = np.clip(np.searchsorted(known, time), 1, len(known) - 1)
    return np.where(time - known[after - 1] < known[after] - time, known[after - 1], known[after])


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
        doubts.append("the contact had not ended when the recording ended")
    needed = 1.0 / table["rate"]
    if source_period > needed * (1.0 + RATE_TOLERANCE) and not all(resolved(contact, needed) for contact in contacts):
        doubts.append(f"an impact needs {table['rate']:g} samples per second, and the messages do not prove that rate")
    unique_doubts = tuple(dict.fromkeys(doubts))
    models: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
    for contact, time, force, usable in samples:
        if _usable(contact).any() and usable.any():
            model = contact.other.rpartition("::")[0].partition("::")[0]  # outermost of nested models; "": no name
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
    """Return True for messages of a contact with a valid force, shape (n,)."""
    return np.isfinite(contact.series.force) & (contact.series.force >= 0.0)


def _samples(contact: RegionContact) -> Samples:
    """Return the force samples of one contact, including its begin and peaks between two messages."""
    series = contact.series
    rose = series.reached != np.concatenate([[0.0], series.reached[:-1]])  # True for NaN, too
    at = np.where(np.isfinite(series.reached_time), series.reached_time, series.time)[rose]
    at = np.clip(at, contact.begin, series.time[rose])
    nearest = _nearest(at, series.time)
    at = np.where(np.abs(at - nearest) <= 0.5 * SAME_INSTANT, nearest, at)  # the times are rounded
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
    """Return the reasons why one contact cannot be called within limits.

    Args:
        contact: recorded contact.
        time: times of the contact's force samples, shape (n,) [s].
        force: force samples, shape (n,) [N].
        recorded_until: robot time of the last message of the topic [s].
        largest: largest force on the region in all contacts [N]; only near it a sensor can be saturated.
    """
    series, doubts = contact.series, list[str]()
    bad = ~(_usable(contact) & np.isfinite(series.reached) & (series.reached >= 0.0))
    if (series.force > series.reached * (1.0 + RATE_TOLERANCE)).any():
        doubts.append("a force exceeds the peak stated in the same message")
    for name, value in (("impulse", contact.impulse), ("energy", contact.energy)):
        if value is not None and not value >= 0.0:
            doubts.append(f"the contact's {name} is NaN or negative")
    peak, longest = _largest(contact), contact.duration + 2.0 * min(_period(np.unique(series.time)), CLOCKS)
    if contact.impulse is not None and contact.impulse > (1.0 + RATE_TOLERANCE) * peak * max(longest, 0.0):
        doubts.append(f"the contact's impulse of {contact.impulse:.3g} N s needs a larger force than the recorded one")
    if not bad.any() and not peak > 0.0:
        doubts.append("no force is measured: it is 0 N during the whole contact")
    if bad.any():
        doubts.append(f"{int(bad.sum())} of {len(bad)} forces are NaN, infinite or negative")
    stated = contact.begin + series.since_begin
    if not (np.abs(series.time - stated) <= CLOCKS).all() or not contact.duration >= 0.0:
        doubts.append("the messages' stamps do not agree with the begin and duration that they state")
    at_range = force.max() >= (1.0 - COARSEST) * largest
    if not bad.any() and at_range and _flat(contact, time[1:], force[1:]):  # without the begin, which has no message
        doubts.append(f"the force has a flat top at {force.max():.1f} N, as from a saturated sensor")
    if contact.interrupted:
        doubts.append("some messages report neither the contact nor its end, as if there were a second publisher")
    end = end_of(contact)
    if not contact.ended and recorded_until - end > verdict_table()["max_gap"]:
        doubts.append(f"the contact's end is not recorded: its last message is from {end:.3f} s")
    return doubts


def _flat(contact: RegionContact, time: FloatArray, force: FloatArray) -> bool:
    """Return True if the largest force forms a flat top, within sensor noise, between steep flanks.

    The top has at least FLAT samples, or two of which one is a peak stated for a time between messages.
    """
    between = np.abs(time - _nearest(time, contact.series.time)) > SAME_INSTANT
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
    """Return an upper bound [N] of the quasi-static force in gaps of the samples, from the peaks in the messages.

    Return None if no gap is longer than may be bridged by interpolation.
    """
    held, max_gap = episode.overall.begin + table["transient_time"], verdict_table()["max_gap"]
    bound, any_unknown = 0.0, False
    for contact, time, _, usable in samples:
        any_unknown |= bool(unknown(time, usable, (max(held, contact.begin), end_of(contact)), max_gap))
        bound += float(contact.series.reached[np.isfinite(contact.series.reached)].max(initial=0.0))
    return bound if any_unknown else None
