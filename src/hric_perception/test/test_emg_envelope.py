"""Compares the envelope with scipy's filters applied to the whole recording at once."""

import subprocess
import sys

import numpy as np
import pytest
from scipy import signal
from std_srvs.srv import SetBoolRequest

from hric_core.errors import HricError, ParameterError
from hric_core.local.node import LocalNode
from hric_perception.chunk import Chunk, Layout
from hric_perception.emg.envelope import Envelope, EnvelopeSettings
from hric_perception.emg.muscles import AMPLITUDE, FLOOR, PROGRAM, EmulatedMuscles
from hric_perception.emg.publisher import MvcService
from hric_perception.emulation import EvenSensor, Faults

RATE = 2000.0
LAYOUT = Layout("test", ("biceps", "triceps", "time"), ("V", "V", "s"), RATE)


def read_program(content, count):
    return PROGRAM.checked(content, "activation").activation(count)


SETTINGS = EnvelopeSettings(mvc={"biceps": 5e-4}, decimate=7)


@pytest.fixture(scope="module")
def data() -> np.ndarray:
    muscles = EmulatedMuscles(read_program({"program": "constant", "level": 0.5}, 2), 2, RATE, seed=3)
    sensor = EvenSensor(RATE, 2, muscles, Faults(bias=1e-4, time_code=True))
    sensor.due(0.0)
    return np.concatenate([part.data for now in np.arange(0.5, 3.5, 0.5) for part in sensor.due(now)])


def offline(data: np.ndarray) -> np.ndarray:
    """Return the envelope computed independently of the node: transfer functions of scipy over the whole recording."""
    z = data[:, :2]
    z = signal.lfilter(*signal.butter(2, [20, 450], "bandpass", fs=RATE), z, axis=0)
    z = signal.lfilter(*signal.iirnotch(50, 30, fs=RATE), z, axis=0)
    z = signal.sosfilt(signal.butter(4, 6, fs=RATE, output="sos"), np.abs(z), axis=0)
    return z / [5e-4, 1.0]


def streamed(data: np.ndarray, sizes: list[int], first: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (envelope, sequence numbers, times) of a recording cut into chunks of the given sizes in turn."""
    chain, parts, at = Envelope(SETTINGS, LAYOUT), [], 0
    while at < len(data):
        size = sizes[len(parts) % len(sizes)]
        parts.append(chain.add(Chunk(LAYOUT, (first + at) / RATE, first + at, data[at : at + size])))
        at += size
    kept = [part for part in parts if part is not None]
    return (
        np.concatenate([part.data for part in kept]),
        np.concatenate([np.arange(part.first, part.after) for part in kept]),
        np.concatenate([part.times for part in kept]),
    )


@pytest.mark.parametrize("sizes", [[20], [1], [1, 27, 400, 3, 64], [10**6]], ids=["20", "1", "mixed", "all at once"])
def test_the_envelope_is_that_of_the_whole_recording_whatever_the_size_of_blocks(
    data: np.ndarray, sizes: list[int]
) -> None:
    smooth, numbers, times = streamed(data[:700] if sizes == [1] else data, sizes)
    reference = offline(data[:700] if sizes == [1] else data)[::7]
    assert smooth.shape == reference.shape
    assert np.abs(smooth - reference).max() < 1e-6 * np.abs(reference).max()
    assert (np.diff(numbers) == 1).all() and np.allclose(times, numbers * 7 / RATE)


def test_the_time_code_has_no_envelope_and_units_are_those_of_the_normalisation() -> None:
    layout = Envelope(SETTINGS, LAYOUT).layout
    assert (layout.channels, layout.units, layout.rate) == (("biceps", "triceps"), ("MVC", "V"), RATE / 7)


def test_a_nan_gives_nan_in_its_place_and_spoils_nothing_afterwards(data: np.ndarray) -> None:
    broken = data.copy()
    broken[2003:2010, 0] = np.nan
    smooth, _, _ = streamed(broken, [20])
    assert np.isnan(smooth[2009 // 7, 0]) and np.isfinite(smooth[:, 1]).all()
    assert np.isnan(smooth[:, 0]).sum() == 1
    assert np.isfinite(smooth[290:, 0]).all()
    clean = offline(data)[::7]
    assert np.abs(smooth[-200:, 0] - clean[-200:, 0]).max() < 1e-3


def test_a_long_gap_restarts_the_filters_and_a_short_one_does_not(data: np.ndarray) -> None:
    chain = Envelope(SETTINGS, LAYOUT)
    before = chain.add(Chunk(LAYOUT, 0.0, 0, data[:1400]))
    short = chain.add(Chunk(LAYOUT, 0.705, 1410, data[1410:1424]))
    assert before is not None and short is not None
    assert short.data[0, 1] == pytest.approx(before.data[-1, 1], rel=0.1)
    long = chain.add(Chunk(LAYOUT, 5.0, 10003, data[:14]))
    assert long is not None and long.first == 10003 // 7 and long.data[0, 1] < 0.01 * before.data[-1, 1]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"lowpas": 6}, "lowpas"),
        ({"band": [20]}, "2 finite numbers"),
        ({"lowpass": -1}, "lowpass is -1"),
        ({"mvc": {"biceps": 0}}, "mvc/biceps is 0"),
        ({"decimate": 0.5}, "decimate is 0.5"),
    ],
)
def test_a_wrong_setting_is_named(given: dict, words: str) -> None:
    with pytest.raises(HricError, match=words):
        EnvelopeSettings.of(given, "/emg/envelope")


def test_a_rate_that_cannot_hold_the_band_is_refused() -> None:
    with pytest.raises(
        ParameterError, match="band is 450 Hz; valid with 500 samples per second: above 0, below 250 Hz"
    ):
        Envelope(EnvelopeSettings(), Layout("slow", ("a",), ("V",), 500.0))
    with pytest.raises(ParameterError, match="mvc names the channel 'leg'; valid: biceps, triceps"):
        Envelope(EnvelopeSettings(mvc={"leg": 1.0}), LAYOUT)


def test_emulated_muscles_have_the_amplitude_of_their_activation_and_repeat_with_the_seed() -> None:
    def record(seed: int, cuts: list[float]) -> np.ndarray:
        points = {"program": "points", "points": [[0, 0, 0.5], [1, 0, 0.5], [1.001, 1, 0.5]]}
        sensor = EvenSensor(RATE, 2, EmulatedMuscles(read_program(points, 2), 2, RATE, seed=seed), Faults(seed=seed))
        sensor.due(0.0)
        return np.concatenate([part.data for now in cuts for part in sensor.due(now)])

    one, other = record(1, [0.5, 1.0, 1.5, 2.0]), record(1, np.arange(0.01, 2.001, 0.01).tolist())
    assert (one[: len(other)] == other[: len(one)]).all()
    assert not (one == record(2, [0.5, 1.0, 1.5, 2.0])).any()
    rms = np.sqrt((one[2200:] ** 2).mean(axis=0))
    assert rms == pytest.approx([AMPLITUDE, 0.5 * AMPLITUDE], rel=0.1)
    assert np.sqrt((one[100:1900, 0] ** 2).mean()) == pytest.approx(FLOOR, rel=0.1)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"program": "dance"}, "no program 'dance' in activation; valid: bursts, c3d, constant, points, topic"),
        ({"level": 2}, "level is 2; valid: a finite number from 0 to 1"),
        ({"program": "points", "points": [[0, 0.1], [0, 0.2]]}, "rows of increasing time"),
        ({"program": "points"}, "rows of increasing time"),
    ],
)
def test_a_wrong_program_of_the_muscles_is_named(given: dict, words: str) -> None:
    with pytest.raises(HricError, match=words):
        read_program(given, 2)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"noise": -1}, "faults.noise is -1; valid: a finite number of 0 or more"),
        ({"dropouts": [[1]]}, "dropouts.0. is .1.; valid: a list of 2 finite numbers"),
        ({"time_code": "yes"}, "faults.time_code is 'yes'; valid: true or false"),
    ],
)
def test_a_wrong_fault_is_named(given: dict, words: str) -> None:
    with pytest.raises(HricError, match=words):
        Faults.of(given, "faults")


def test_drop_outs_and_noise_repeat_with_the_seed_and_do_not_depend_on_when_samples_are_fetched() -> None:
    def record(seed: int, step: float) -> tuple[np.ndarray, np.ndarray]:
        faults = Faults(noise=0.1, dropout_rate=5.0, dropout_length=0.03, time_code=True, seed=seed)
        sensor = EvenSensor(1000.0, 1, lambda first, times: np.zeros((len(times), 1)), faults)
        parts = [part for now in np.arange(0.0, 3.0001, step) for part in sensor.due(now)]
        assert sensor.dropped > 50 and sensor.sent + sensor.dropped == 3000
        return np.concatenate([part.times for part in parts]), np.concatenate([part.data for part in parts])

    (times, data), (other_times, other) = record(1, 0.01), record(1, 0.5)
    assert (times == other_times).all() and (data == other).all() and (data[:, 1] == times).all()
    assert len(record(2, 0.5)[0]) != len(times)


def test_the_filters_are_loaded_with_the_node_and_not_while_the_first_samples_wait() -> None:
    code = "import sys, hric_perception.emg.publisher; assert 'scipy.signal' in sys.modules"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


def test_a_channel_without_a_known_sample_has_no_maximum():
    node = LocalNode()
    service = MvcService(node)
    assert node.call("record_mvc", SetBoolRequest(True)).success
    service.take(Chunk(LAYOUT, 0.0, 0, np.array([[np.nan, 2e-4, 0.1], [np.nan, np.nan, 0.2]])))
    response = node.call("record_mvc", SetBoolRequest(False))
    assert not response.success and response.message.startswith("all samples of biceps are NaN or 0")
    assert not node.has_param("measured_mvc")
