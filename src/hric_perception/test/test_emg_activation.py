"""Emulated EMG of a simulated human's muscles: which muscle a channel measures, how late its envelope is.

Each transport is also tested in one process.
"""

import math
from typing import Any

import numpy as np
import pytest
from scipy import signal
from sweeping_muscles import message

from hric_core.local.node import LocalNode
from hric_core.robot_time import stamps
from hric_msgs.msg import MuscleActivation, SampleChunk
from hric_perception.chunk import Chunk, Layout, read_chunk
from hric_perception.emg.device import EmulatedEmgSettings, activation_of
from hric_perception.emg.envelope import Envelope, EnvelopeSettings, band_sections, lag
from hric_perception.emg.muscles import MUSCLES, PROGRAM, EmulatedMuscles
from hric_perception.emg.publisher import EmgSettings
from hric_perception.sampled import headless

RATE = 2000.0
TOPIC = "/hric/human/activation"


def activation(time: float, **values: float) -> Any:
    told = MuscleActivation(name=list(values), activation=list(values.values()))
    told.header.stamp = stamps.to_time(time)
    return told


def listening(channels: tuple[str, ...], **program: Any) -> tuple[LocalNode, Any, Any, list[str]]:
    """Return (node, activation of the channels, function for the time up to which it is known, errors)."""
    node, told = LocalNode(), list[str]()
    node.log_error = told.append  # type: ignore[method-assign]
    given = PROGRAM.checked({"program": "topic", **program}, "activation")
    return node, *activation_of(node, given, channels), told


def test_a_channel_of_a_muscles_own_name_measures_that_muscle_on_straight_lines_between_messages() -> None:
    node, measured, known, _ = listening(("right_supra_a", "right_bic_l"))
    assert known() == -math.inf
    topic = node.advertise(TOPIC, MuscleActivation)
    topic.publish(activation(5.0, right_bic_l=0.1, left_bic_l=0.9, right_supra_a=0.2))
    topic.publish(activation(5.01, right_bic_l=0.3, left_bic_l=0.9, right_supra_a=0.6))
    assert known() == 5.01
    found = measured(np.array([4.0, 5.0, 5.005, 6.0]))
    assert found == pytest.approx(np.array([[0.2, 0.1], [0.2, 0.1], [0.4, 0.2], [0.6, 0.3]]))


@pytest.mark.parametrize(("side", "other"), [("right", "left"), ("left", "right")])
def test_a_usual_channel_measures_the_mean_of_its_parts_on_its_side(side: str, other: str) -> None:
    node, measured, _, _ = listening(("triceps", "wrist_flexors"), side=side)
    values = {"tric_long": 0.1, "tric_med": 0.2, "tric_lat": 0.6, "wr_flex+": 0.05}
    own = {f"{side}_{name}": value for name, value in values.items()}
    others = {f"{other}_{name}": 1.0 for name in values}
    node.advertise(TOPIC, MuscleActivation).publish(activation(1.0, **own, **others))
    assert measured(np.array([1.0]))[0] == pytest.approx([0.3, 0.05])


def test_messages_without_its_muscles_are_refused_once_with_what_there_is() -> None:
    node, _, known, told = listening(("biceps", "soleus"))
    topic = node.advertise(TOPIC, MuscleActivation)
    for time in (1.0, 1.005, 1.01):
        topic.publish(activation(time, right_bic_l=0.1, left_bic_l=0.2))
    assert len(told) == 1 and known() == -math.inf
    assert "the message has no activation of right_bic_b, soleus; it has right_bic_l, left_bic_l" in told[0]
    topic.publish(activation(2.0, right_bic_l=0.1, right_bic_b=0.3, soleus=0.0))
    assert known() == 2.0, "messages that have them are taken from then on"


def test_the_stated_lag_of_the_envelope_is_the_group_delay_of_its_filters() -> None:
    settings = EnvelopeSettings()
    # Closed form of a Butterworth low-pass of order 4 at frequency 0: 2 (sin(pi/8) + sin(3 pi/8)) / w.
    low = 2.0 * (math.sin(math.pi / 8.0) + math.sin(3.0 * math.pi / 8.0)) / (2.0 * math.pi * settings.lowpass)
    # A mean group delay, each frequency by its power, is the centroid of the squared impulse response.
    h, k = signal.sosfilt(band_sections(settings, RATE), np.eye(1, 20000)[0]), np.arange(20000)
    band = float((k * h**2).sum() / (h**2).sum()) / RATE
    assert lag(settings, RATE) == pytest.approx(low + band, abs=1e-5) and 0.001 < band < 0.003


def test_the_envelope_of_muscles_that_swell_once_a_second_is_late_by_the_stated_lag() -> None:
    settings, w, count = EnvelopeSettings(decimate=1), 2.0 * math.pi, 8
    muscles = EmulatedMuscles(
        lambda times: np.tile(0.25 + 0.15 * np.sin(w * times)[:, None], count), count, RATE, seed=2
    )
    layout = Layout("test", MUSCLES, ("V",) * count, RATE)
    times = np.arange(int(30 * RATE)) / RATE
    smooth = Envelope(settings, layout).add(Chunk(layout, 0.0, 0, muscles(0, times)))
    assert smooth is not None
    kept = times >= 2.0  # whole periods after the filters have settled
    phase = -np.angle((smooth.data[kept].mean(axis=1) * np.exp(-1j * w * times[kept])).sum() * 1j)
    # The mean of 8 channels over 28 s is known to 1 ms: it fluctuates by 3 % in pieces of 0.08 s.
    assert phase / w == pytest.approx(lag(settings, RATE), abs=4e-3)


def streamed(transport: str, seed: int = 0, late: int = 0, **device: Any) -> list[Chunk]:
    """Return raw samples of 2 s from one process; late: delay of the person's messages [ms]."""
    faults = {"time_code": True, **device.pop("faults", {})}
    trigno = {"trigno": {"channels": [*MUSCLES, "time"]}} if transport == "trigno" else {}
    emulated = {"activation": {"program": "topic"}, "transport": transport, "seed": seed, "faults": faults, **device}
    node = LocalNode({"emg": {"source": transport, "chunk": 0.05, **trigno}, "emulated_emg": emulated})
    driver, device = node.child("emg"), node.child("emulated_emg")
    sensor, told = headless(EmgSettings.read(driver), EmulatedEmgSettings.read(device), driver, device), list[Any]()
    node.subscribe("/hric/perception/emg/raw", SampleChunk, told.append)
    topic = node.advertise(TOPIC, MuscleActivation)
    for k in range(2000):
        now = 1e-3 * k
        if k >= late and (k - late) % 5 == 0:
            topic.publish(message(now - 1e-3 * late, 2.0))
        sensor.advance(now)
    return [read_chunk(chunk) for chunk in told]


def joined(chunks: list[Chunk]) -> tuple[np.ndarray, np.ndarray]:
    """Return (sequence numbers, data) of all chunks."""
    numbers = np.concatenate([np.arange(chunk.first, chunk.after) for chunk in chunks])
    return numbers, np.concatenate([chunk.data for chunk in chunks])


def test_samples_wait_for_the_activation_that_they_show_and_none_is_lost() -> None:
    prompt, late = (joined(streamed("lsl", late=late)) for late in (0, 60))
    count = len(late[0])
    assert (late[0] == np.arange(count)).all() and 1800.0 < count / 2.0 <= 1930.0
    # A message that comes later is the same one: nothing was guessed.
    np.testing.assert_allclose(late[1], prompt[1][:count], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("transport", "bound"), [("lsl", 1e-9), ("trigno", 1e-6)])
def test_stamps_are_the_times_of_the_samples_by_each_transport(transport: str, bound: float) -> None:
    for chunk in streamed(transport):
        off = chunk.times - chunk.data[:, -1]
        assert np.abs(off - np.round(off)).max() < bound


def test_trigno_rounds_the_same_samples_to_32_bits_and_all_repeats_with_the_seed() -> None:
    lsl, again, other = (joined(streamed("lsl", seed))[1] for seed in (3, 3, 4))
    assert np.array_equal(lsl, again) and not (lsl[:, 0] == other[:, 0]).any()
    trigno = joined(streamed("trigno", 3))[1]
    count = min(len(lsl), len(trigno))
    assert count > 3700 and np.array_equal(trigno[:count, :8], lsl[:count, :8].astype(np.float32))


def test_samples_that_are_dropped_are_missing_in_the_numbers() -> None:
    numbers, data = joined(streamed("lsl", faults={"dropouts": [[0.5, 0.3]]}))
    assert sorted(set(np.diff(numbers).tolist())) == [1, 601]
    assert np.array_equal(numbers, np.rint(RATE * data[:, -1]))
