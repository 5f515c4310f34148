"""The force of contacts over time from their messages, and what is not known of it; forces that are sums of steps."""

import math
import tracemalloc
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hric_assessment.contact.episodes import Episode, end_of, episodes, resolved, window_of
from hric_human.contact import ContactSeries, RegionContact

PERIOD = 1e-3
"""Period of the source [s]."""


def contact(
    force: Any, begin: float = 1.0, duration: float = 0.2, step: float = 0.01, series: Any = None, **changes: Any
) -> RegionContact:
    """A contact with a message every `step`, from one step after its begin to its end.

    Args:
        force: at the messages, a number or one for each [N].
        series: changes of the time series.
    """
    since = step * np.arange(1, round(duration / step) + 1)
    level = np.broadcast_to(np.asarray(force, float), since.shape).copy()
    reached = np.fmax.accumulate(level) if len(level) else level
    first = np.searchsorted(reached, reached) if len(level) else np.empty(0, int)
    where, time = np.zeros((len(since), 3)), begin + since
    made = ContactSeries(time, level, reached, time[first % max(len(time), 1)], since, where, where)
    about: dict[str, Any] = {"regions": ("hand, fingers",), "link": "r_wrist", "other": "panda::panda_hand"}
    about |= {"kind": "penalty", "begin": begin, "duration": duration, "peak": None, "peak_time": None}
    about |= {"impulse": None, "begin_point": None, "begin_normal": None, "begin_speed": None, "ended": True}
    return RegionContact(**{**about, "series": replace(made, **(series or {})), **changes})


def changed(changes: dict[str, Any]) -> RegionContact:
    """Return a contact of 0.2 s with a changed time series and otherwise unchanged messages."""
    made = contact(5.0, series=changes.get("series"))
    return replace(made, **{name: value for name, value in changes.items() if name != "series"})


def only(*contacts: RegionContact, period: float = PERIOD, until: float = 9.0) -> Episode:
    (episode,) = episodes(contacts, period, until)
    return episode


def sine(peak: float, count: int = 20) -> np.ndarray:
    return peak * np.sin(math.pi * np.arange(1, count + 1) / (count + 1))


# -- when --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "end"),
    [
        ({}, 1.2),
        ({"duration": 0.5}, 1.5),
        ({"duration": math.nan}, 1.2),
        ({"duration": 0.1}, 1.2),
        ({"series": {"time": np.full(20, math.nan)}}, 1.2),
        ({"duration": math.nan, "series": {"time": np.full(20, math.nan)}}, 1.0),
        ({"duration": math.nan, "series": {"time": np.append(1.05, np.full(19, math.nan))}}, 1.05),
    ],
)
def test_a_contact_ends_when_it_says_or_with_its_last_message(changes: dict[str, Any], end: float) -> None:
    assert end_of(changed(changes)) == pytest.approx(end)


@pytest.mark.parametrize(("pause", "count"), [(0.1, 1), (0.101, 2)])
def test_contacts_no_farther_apart_than_the_gap_are_one_whatever_their_order(pause: float, count: int) -> None:
    first, second = contact(5.0), contact(7.0, begin=1.2 + pause)
    found = episodes([second, first], PERIOD, 9.0)
    assert len(found) == count
    assert window_of(found[0].contacts) == pytest.approx((1.0, 1.4 + pause if count == 1 else 1.2))
    assert found[-1].contacts[-1] is second


def test_a_short_contact_within_a_long_one_does_not_end_it() -> None:
    long, short, last = contact(5.0, duration=2.0), contact(5.0, begin=1.5), contact(5.0, begin=2.9)
    assert only(long, short, last).contacts == (long, short, last)


def test_a_contact_that_does_not_say_when_it_began_is_one_of_its_own() -> None:
    assert len(episodes([contact(5.0), contact(5.0, begin=math.nan)], PERIOD, 9.0)) == 2


@pytest.mark.parametrize(
    ("about", "fast"),
    [
        ({"step": 0.001}, True),
        ({"step": 0.01}, False),
        ({"step": 0.005, "begin": 1.001}, False),  # one instant off the beat is chance
        ({"step": 0.005, "series": {"reached_time": np.full(40, 1.032)}}, False),
        ({"step": 0.005, "duration": 0.198, "series": {"reached_time": np.full(40, 1.033)}}, True),
        ({"step": 0.005, "duration": 0.198, "series": {"reached_time": np.full(40, 1.0334)}}, False),  # no whole period
    ],
)
def test_a_source_is_fast_where_its_messages_are_or_name_instants_between_them(
    about: dict[str, Any], fast: bool
) -> None:
    duration = about.get("duration", 0.2)
    made = contact(5.0, **{**about, "duration": 0.2})
    made = replace(made, duration=duration, series=replace(made.series, time=made.series.time - (0.2 - duration) / 2.0))
    assert resolved(made, PERIOD) is fast


@pytest.mark.parametrize(
    ("begin", "duration", "peak_time", "fast"),
    [
        (1.002, 0.011, 1.005, True),
        (1.0023, 0.011, 1.0053, True),  # whole milliseconds apart, wherever they begin
        (1.002, 0.0113, 1.005, False),
        (1.005, 0.011, 1.005, False),  # the end alone is no instant of the message
        (1.002, 0.003, 1.005, False),  # nor is the begin
    ],
)
def test_a_source_with_a_single_message_is_fast_where_two_other_instants_are_whole_periods_from_it(
    begin: float, duration: float, peak_time: float, fast: bool
) -> None:
    """The message is from the time of the peak."""
    at = np.array([peak_time])
    made = contact(5.0, duration=0.01, series={"time": at, "reached_time": at})
    assert resolved(replace(made, begin=begin, duration=duration), PERIOD) is fast


@pytest.mark.parametrize(("step", "fast"), [(0.001, True), (0.0015, False)])
def test_two_messages_are_as_far_apart_as_the_evaluations_of_their_source(step: float, fast: bool) -> None:
    assert resolved(contact(5.0, step=step, duration=2.0 * step), PERIOD) is fast


def test_one_instant_that_is_stated_twice_and_rounded_is_one() -> None:
    made = contact(5.0, step=0.005)
    stated = replace(made.series, reached_time=np.full(40, made.begin + 0.198 + 1e-9), time=made.series.time - 0.005)
    assert not resolved(replace(made, duration=0.198, series=stated), PERIOD)


def test_a_contact_whose_messages_have_no_time_does_not_show_how_fast_its_source_is() -> None:
    assert not resolved(contact(5.0, series={"time": np.full(20, math.nan)}), PERIOD)


# -- force -------------------------------------------------------------------------------------------------------------


def test_forces_of_two_links_are_added_while_both_press_and_at_no_other_time() -> None:
    """100 N from 1.0 s to 1.2 s, 60 N from 1.15 s to 2.0 s: 160 N for a moment, then held 60 N."""
    episode = only(contact(100.0), contact(60.0, begin=1.15, duration=0.85, other="panda::panda_leftfinger"))
    assert episode.quasi_static is not None
    assert (episode.transient.peak, episode.quasi_static.peak) == (pytest.approx(160.0), pytest.approx(60.0))
    assert (episode.overall.begin, episode.overall.end) == (1.0, pytest.approx(2.0))


def test_a_link_that_comes_later_presses_with_nothing_before() -> None:
    later = contact(60.0, begin=1.6, duration=0.4, other="panda::panda_leftfinger")
    episode = only(contact(100.0, duration=1.0), later)
    assert episode.quasi_static is not None
    assert (episode.transient.peak, episode.quasi_static.peak) == (100.0, pytest.approx(160.0))


def test_the_impulse_is_the_sum_of_those_that_the_messages_state() -> None:
    episode = only(contact(5.0, impulse=0.4), contact(5.0, begin=1.1, impulse=0.7), contact(5.0, impulse=None))
    assert episode.overall.impulse == pytest.approx(1.1)


def test_one_message_gives_the_force_and_none_gives_nothing() -> None:
    single = only(contact(30.0, duration=0.01))
    assert single is not None and (single.overall.peak, single.overall.peak_time) == (30.0, pytest.approx(1.01))
    assert only(contact(30.0, duration=0.01)).doubts == ()
    assert only(contact(math.nan)).known is False


@pytest.mark.parametrize(
    ("period", "step", "duration", "rate"),
    [
        (PERIOD, 0.01, 0.2, 1000.0),
        (math.inf, 0.01, 0.2, 100.0),
        (math.inf, 0.02, 0.02, 50.0),
        (math.inf, 0.02, 0.0, 0.0),
    ],
    ids=["source", "messages", "begin and message", "one instant"],
)
def test_an_episode_has_the_rate_of_its_source_or_of_what_is_known_of_it(
    period: float, step: float, duration: float, rate: float
) -> None:
    made = contact(5.0, step=step, duration=max(duration, step))
    begin = made.series.time[0] if duration == 0.0 else made.begin
    episode = only(replace(made, begin=begin), period=period)
    assert episode.rate == pytest.approx(rate)


@pytest.mark.parametrize(
    ("first", "second", "peak"),
    [
        ("panda::panda_hand", "panda::gripper::finger", 160.0),
        ("panda::arm::panda_hand", "panda::gripper::finger", 160.0),
        ("panda_hand", "finger", 160.0),
        ("panda::panda_hand", "wall::link", 100.0),
    ],
)
def test_links_of_a_model_with_those_of_models_in_it_and_links_of_no_named_model_are_added(
    first: str, second: str, peak: float
) -> None:
    episode = only(contact(100.0, other=first), contact(60.0, other=second))
    assert episode.overall.peak == pytest.approx(peak)


@pytest.mark.parametrize(
    ("stated", "at"),
    [(1.033, 1.033), (math.nan, 1.04), (1.3, 1.04), (0.5, 1.0)],
    ids=["between", "unknown", "later than its message", "before the begin"],
)
def test_a_peak_counts_when_it_is_stated_to_have_been_from_the_begin_to_its_message(stated: float, at: float) -> None:
    made = contact(sine(50.0))
    reached, times = made.series.reached.copy(), made.series.reached_time.copy()
    reached[3:], times[3:] = 90.0, stated
    episode = only(replace(made, series=replace(made.series, reached=reached, reached_time=times)))
    assert (episode.overall.peak, episode.overall.peak_time) == (90.0, pytest.approx(at))


def test_a_newton_before_the_first_message_counts() -> None:
    episode = only(contact(0.5, duration=0.01, series={"reached": np.array([1.0])}))
    assert episode.overall.peak == 1.0


def test_a_contact_without_force_for_a_while_is_known_to_have_none() -> None:
    episode = only(contact(np.repeat([50.0, 0.0], 100), duration=2.0))
    assert (episode.doubts, episode.unknown_peak) == ((), None)


@pytest.mark.parametrize("bad", [math.nan, -5.0, math.inf])
def test_a_force_that_is_none_is_left_out_and_counted(bad: float) -> None:
    force = sine(50.0)
    force[[4, 5]] = bad
    reached = np.maximum.accumulate(sine(50.0))
    episode = only(contact(force, series={"reached": reached}))
    assert episode.overall.peak == pytest.approx(max(sine(50.0)))
    assert "2 of 20 forces are NaN, infinite or negative" in episode.doubts


def test_peaks_that_are_none_are_counted_too() -> None:
    reached = np.maximum.accumulate(sine(50.0))
    reached[:3] = [math.nan, -1.0, math.inf]
    doubts = only(contact(sine(50.0), series={"reached": reached})).doubts
    assert "3 of 20 forces are NaN, infinite or negative" in doubts


@pytest.mark.parametrize("force", [50.0, 50.04, 74.0])
def test_a_force_above_the_peak_that_its_message_states_is_told_beyond_rounding(force: float) -> None:
    told = ("a force exceeds the peak stated in the same message",) if force > 50.05 else ()
    made = contact(np.array([10.0, force, 20.0]), duration=0.03, series={"reached": np.array([10.0, 50.0, 50.0])})
    assert only(made).doubts == told


@pytest.mark.parametrize(
    ("impulse", "told"), [(None, False), (0.0, False), (0.5, False), (-0.1, True), (math.nan, True)]
)
def test_an_impulse_that_is_none_is_told(impulse: float | None, told: bool) -> None:
    words = ("the contact's impulse is NaN or negative",) if told else ()
    assert only(contact(sine(50.0), impulse=impulse)).doubts == words


# -- what is not known -------------------------------------------------------------------------------------------------


def test_of_a_contact_that_is_recorded_from_its_begin_to_its_end_nothing_is_unknown() -> None:
    episode = only(contact(sine(50.0)))
    assert (episode.doubts, episode.unknown_peak) == ((), None)


@pytest.mark.parametrize(("duration", "told"), [(0.3, True), (0.5, True), (0.51, False)])
def test_a_blow_that_had_not_ended_may_have_become_harder(duration: float, told: bool) -> None:
    going_on = contact(sine(50.0, round(100 * duration)), duration=duration, ended=False)
    assert only(going_on, until=1.0 + duration).doubts == (
        ("the contact had not ended when the recording ended",) if told else ()
    )
    over = contact(1.0, duration=duration, other="panda::panda_leftfinger")
    assert bool(only(over, going_on, until=1.0 + duration).doubts) == told


@pytest.mark.parametrize(("period", "slow"), [(1e-3, False), (1.0005e-3, False), (1.0 / 600.0, True), (math.inf, True)])
def test_a_source_slower_than_a_blow_needs_is_told(period: float, slow: bool) -> None:
    told = ("an impact needs 1000 samples per second, and the messages do not prove that rate",) if slow else ()
    assert only(contact(sine(50.0)), period=period).doubts == told


@pytest.mark.parametrize(
    ("series", "duration", "told"),
    [
        ({"since_begin": 0.019 + 0.01 * np.arange(1, 21)}, 0.2, False),
        ({"since_begin": 0.021 + 0.01 * np.arange(1, 21)}, 0.2, True),
        ({"since_begin": -0.021 + 0.01 * np.arange(1, 21)}, 0.2, True),
        ({"since_begin": np.append(0.01 * np.arange(1, 20), math.nan)}, 0.2, True),
        ({}, -0.1, True),
        ({}, math.nan, True),
        ({}, 0.0, False),
    ],
)
def test_messages_of_another_time_than_they_state_are_told(series: dict[str, Any], duration: float, told: bool) -> None:
    found = only(replace(contact(sine(50.0), series=series), duration=duration)).doubts
    assert found == (("the messages' stamps do not agree with the begin and duration that they state",) if told else ())


@pytest.mark.parametrize(("after", "told"), [(0.09, False), (0.11, True)])
def test_an_end_that_ought_to_have_been_recorded_is_told(after: float, told: bool) -> None:
    pressing = contact(np.linspace(5.0, 9.0, 100), duration=1.0, ended=False)
    assert only(pressing, until=2.0 + after).doubts == (
        ("the contact's end is not recorded: its last message is from 2.000 s",) if told else ()
    )


def test_messages_of_a_second_publisher_are_told() -> None:
    words = "some messages report neither the contact nor its end, as if there were a second publisher"
    assert only(contact(sine(50.0), interrupted=True)).doubts == (words,)


def test_a_doubt_of_two_links_is_told_once() -> None:
    both = [contact(sine(50.0), interrupted=True, other=f"panda::{link}") for link in ("panda_hand", "panda_link7")]
    assert len(only(*both).doubts) == 1


FLAT = [10.0, 60.0, 60.0, 60.0, 20.0]


@pytest.mark.parametrize(
    ("force", "flat"),
    [
        (FLAT, True),
        ([60.0, 60.0, 60.0, 21.3, 10.7], True),
        ([10.7, 21.3, 60.0, 60.0, 60.0], True),
        ([10.0, 20.0, 60.0, 60.0, 60.0], False),
        ([10.0, 60.0, 60.0, 30.0, 20.0], False),
        ([60.0, 60.0, 20.0, 60.0, 60.0], False),
        ([10.0, 60.0, 59.985, 60.0, 20.0], True),
        ([10.03, 60.0, 59.9, 60.0, 20.0], False),
        ([59.3, 59.8, 60.0, 60.0, 60.0, 59.8, 59.3], False),
        ([58.3, 59.0, 60.0, 60.0, 60.0, 59.9, 59.8], True),
        ([59.8, 59.9, 60.0, 60.0, 60.0, 59.0, 58.3], True),
        ([60.0, 60.0, 20.0, 60.0, 60.0, 60.0, 20.0], True),
        ([60.0, 60.0, 60.0, 60.0, 60.0], False),
        ([60.0, 60.0, 60.0, 60.0, 20.0], True),
        ([1.2, 60.0, 60.0, 60.0, 59.9, 59.83], True),
        ([59.83, 59.9, 60.0, 60.0, 60.0, 1.2], True),
        ([0.5, 60.0, 60.0, 60.0, 59.9, 59.83], False),
        ([59.83, 59.9, 60.0, 60.0, 60.0, 0.5], False),
        ([20.0, 60.0, 60.0, 60.0, 60.0], True),
        ([55.0, 58.0, 60.0, 60.0, 60.0, 58.0, 57.0], False),  # three steps of a sensor of 1 N
        ([54.0, 58.0, 60.0, 60.0, 60.0, 58.0, 57.0], True),
        ([10.0, 60.0, 60.0, 60.0, math.nan, 20.0], True),
    ],
)
def test_a_largest_force_that_is_held_to_the_last_bit_between_steep_sides_is_a_flat_top(
    force: list[float], flat: bool
) -> None:
    """Steep: between the two messages before or behind, by more than a hundredth of it; a contact begins and ends
    without force."""
    found = only(contact(np.array(force), duration=0.01 * len(force))).doubts
    told = [one for one in found if one == "the force has a flat top at 60.0 N, as from a saturated sensor"]
    assert bool(told) == (flat and all(map(math.isfinite, force)))


def sampled(force: Any, count: int = 20) -> str:
    """Doubts of a contact whose force is that of a function of the time of its messages, one each millisecond [s]."""
    made = contact(force(0.001 * np.arange(1, count + 1)), duration=0.001 * count, step=0.001)
    return "; ".join(only(made).doubts)


@pytest.mark.parametrize(
    ("top", "noise", "quantum"),
    [(250.0, 0.005, 0.0), (250.0, 0.01, 0.0), (40.0, 0.01, 0.0), (250.0, 0.9, 1.0), (100.0, 2.0, 4.0), (60.0, 0, 0.5)],
)
@pytest.mark.parametrize("seed", range(5))
def test_a_top_is_flat_with_the_noise_of_a_sensor_and_a_step_of_it(
    top: float, noise: float, quantum: float, seed: int
) -> None:
    def force(time: Any) -> np.ndarray:
        clipped = np.minimum(top, 2.0 * top * np.sin(math.pi * time / 0.021))
        noisy = clipped - np.random.default_rng(seed).uniform(0.0, 2.0 * noise, len(time))
        return np.maximum(noisy if not quantum else quantum * np.ceil(noisy / quantum), 0.0)

    assert "flat top" in sampled(force)


@pytest.mark.parametrize("peak", [0.5, 1.0, 2.0, 5.0, 20.0, 100.0, 250.0, 1000.0])
@pytest.mark.parametrize("quantum", [0.0, 0.001, 0.02, 0.1, 1.0])
def test_a_smooth_peak_of_any_size_length_and_resolution_is_not_flat(peak: float, quantum: float) -> None:
    for length in (0.01, 0.021, 0.03, 0.05, 0.1, 0.3, 1.0):
        for phase in (0.0, 0.25, 0.5, 0.75):

            def force(time: Any, length: float = length, phase: float = phase) -> np.ndarray:
                smooth = peak * np.sin(math.pi * np.clip((time - 0.001 * phase) / length, 0.0, 1.0))
                return smooth if not quantum or quantum > 0.02 * peak else quantum * np.round(smooth / quantum)

            assert "flat top" not in sampled(force, round(1000.0 * length)), (length, phase)


def test_a_peak_time_that_is_rounded_is_no_sample_of_its_own() -> None:
    """Two samples near a smooth peak; the peak's stated time differs from the message's by rounding."""
    made = contact(np.array([24.374, 25.973, 26.548, 26.564, 24.693, 22.404]), duration=0.006, step=0.001)
    series = replace(made.series, reached_time=made.series.reached_time - 2.4e-7)
    assert only(replace(made, series=series)).doubts == ()


def test_a_long_press_needs_memory_in_proportion_to_its_length() -> None:
    tracemalloc.start()
    only(contact(np.full(20_000, 100.0), duration=20.0, step=0.001))
    assert tracemalloc.get_traced_memory()[1] < 100e6
    tracemalloc.stop()


def test_a_top_below_a_newton_is_flat_too() -> None:
    made = contact(np.array([0.1, 0.6, 0.6, 0.6, 0.2]), duration=0.05)
    assert only(made).doubts == ("the force has a flat top at 0.6 N, as from a saturated sensor",)


@pytest.mark.parametrize(("before", "flat"), [(63.1, True), (63.2, False)])
def test_a_force_that_was_exceeded_on_the_region_is_no_range_of_a_sensor(before: float, flat: bool) -> None:
    """An arm stands and presses on after a blow; the two forces differ by a twentieth of the larger one."""
    blow = contact(sine(before, 21), begin=1.0, duration=0.21)
    pressed = contact(np.array([10.0, 60.0, 60.0, 60.0, 20.0]), begin=2.0, duration=0.05)
    assert [bool(episode.doubts) for episode in episodes([blow, pressed], PERIOD, 9.0)] == [False, flat]


@pytest.mark.parametrize("count", [2, 3, 5, 9])
@pytest.mark.parametrize(("share", "flat"), [(0.97, False), (1.03, True)])
def test_a_top_is_flat_where_the_force_comes_to_it_steeper_than_to_twice_a_parabola(
    count: int, share: float, flat: bool
) -> None:
    """A parabola a k^2 whose samples from -h to h differ by `spread` changes by spread (2 h + 3) / h^2 from h + 2 to
    h + 1. The first sample of the top is a stated peak between two messages."""
    half, spread, top = 0.5 * (count - 1), 0.019, 2.0
    slope = share * 2.0 * spread * (2.0 * half + 3.0) / half**2
    force = np.array([1.5 - slope, 1.5, *[top - spread] * (count - 1), 1.5, 1.5])
    made = contact(force, duration=0.01 * len(force))
    reached, times = made.series.reached.copy(), made.series.reached_time.copy()
    reached[2:], times[2:] = top, made.series.time[2] - 0.003
    assert bool(only(replace(made, series=replace(made.series, reached=reached, reached_time=times))).doubts) == flat


@pytest.mark.parametrize(("stated", "flat"), [(1.017, True), (1.02, False)])
def test_two_equal_forces_are_a_flat_top_if_one_is_a_peak_between_messages(stated: float, flat: bool) -> None:
    made = contact(np.array([10.0, 60.0, 20.0]), duration=0.03)
    times = made.series.reached_time.copy()
    times[1:] = stated
    assert bool(only(replace(made, series=replace(made.series, reached_time=times))).doubts) == flat


def lost(begin: float, end: float, force: float = 80.0, **changes: Any) -> RegionContact:
    """A contact of 2 s that rises slowly to a force, whose messages of some time are lost."""
    made = contact(np.linspace(0.9, 1.0, 200) * force, duration=2.0, **changes)
    kept = (made.series.time <= begin + 1e-9) | (made.series.time >= end - 1e-9)
    fields = {name: values[kept] for name, values in vars(made.series).items()}
    return replace(made, series=ContactSeries(**fields))


@pytest.mark.parametrize(
    ("begin", "end", "unknown"), [(2.0, 2.1, False), (2.0, 2.12, True), (1.1, 1.4, False), (1.3, 1.7, True)]
)
def test_a_held_force_is_unknown_where_messages_are_farther_apart_than_may_be_bridged(
    begin: float, end: float, unknown: bool
) -> None:
    assert only(lost(begin, end)).unknown_peak == (pytest.approx(80.0) if unknown else None)


def test_a_held_force_that_is_unknown_is_at_most_the_sum_of_what_all_links_reached() -> None:
    first, second = lost(2.0, 2.5), contact(30.0, duration=2.0, other="panda::panda_leftfinger")
    for pair in ((first, second), (second, first)):
        assert only(*pair).unknown_peak == pytest.approx(110.0)


def test_a_link_of_which_no_peak_is_known_adds_nothing_to_the_bound_and_is_told() -> None:
    blind = contact(0.0, duration=2.0, other="panda::panda_link7", series={"reached": np.full(200, math.nan)})
    episode = only(lost(2.0, 2.5), blind)
    assert episode.unknown_peak == pytest.approx(80.0)
    assert episode.doubts == ("200 of 200 forces are NaN, infinite or negative",)


def test_a_peak_that_is_no_number_bounds_nothing() -> None:
    some = lost(2.0, 2.5)
    reached = some.series.reached.copy()
    reached[-1] = math.nan
    bound = only(replace(some, series=replace(some.series, reached=reached))).unknown_peak
    assert bound == pytest.approx(max(reached[:-1]))
