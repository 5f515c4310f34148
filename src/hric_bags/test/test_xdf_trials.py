"""Recordings of Lab Streaming Layer as trials: an exported run, and files with the faults of real recordings."""

import struct
from dataclasses import dataclass, replace
from pathlib import Path

import export_bags
import numpy as np
import pytest

from hric_bags.export import frames, recording
from hric_bags.export.trial import c3d_format, c3d_trial
from hric_bags.export.trial.c3d_trial import C3dTrial
from hric_bags.export.trial.xdf import write_xdf
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.trial.c3d import read_trial
from hric_core.trial.events import TrialEvent
from hric_motion.trial import read
from hric_perception.replayed import RecordedEmg, RecordedLoad

RATE, COUNT, BEGIN = 100.0, 200, 5000.0
POINT = "".join(
    f"<channel><label>A_{axis}</label><marker>A</marker><unit>millimeters</unit><type>Position{axis}</type></channel>"
    for axis in "XYZ"
)
VOLT = "<channel><label>RBIC</label><unit>microvolts</unit></channel>"


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> C3dTrial:
    truth = export_bags.write(tmp_path_factory.mktemp("bag") / "made_up.bag", mocap_frame="base")
    tables = recording.read(recording.find(str(truth.bag)))
    event = TrialEvent(0.1, "Foot Strike", "Left")
    return replace(c3d_trial.collect(tables, frames.of_run("", tables, {}), {}), events=(event,))


@dataclass
class Stream:
    """Stream of a file: its samples have these times on its own clock, which is `offset` behind that of the file."""

    kind: str
    channels: str
    times: FloatArray
    rate: float = RATE
    offsets: tuple[tuple[float, float], ...] = ((BEGIN, 0.0), (BEGIN + 2.0, 0.0))
    stated: int | None = None
    width: int = 1

    def chunks(self, number: int) -> bytes:
        """Return the chunks of the stream by the specification of the format."""
        head = (
            f"<info><name>{self.kind} {number}</name><type>{self.kind}</type>"
            f"<channel_count>{self.width}</channel_count><nominal_srate>{self.rate}</nominal_srate><channel_format>float32</channel_format><desc><channels>"
            f"{self.channels}</channels></desc></info>"
        )
        rows = b"".join(
            struct.pack("<Bd", 8, time) + np.full(self.width, k, "<f4").tobytes() for k, time in enumerate(self.times)
        )
        count = len(self.times) if self.stated is None else self.stated
        parts = [(2, head.encode()), (3, struct.pack("<BI", 4, len(self.times)) + rows)]
        parts += [(4, struct.pack("<dd", *offset)) for offset in self.offsets]
        parts += [(6, f"<info><sample_count>{count}</sample_count></info>".encode())]
        return b"".join(struct.pack("<BQHI", 8, 6 + len(content), tag, number) + content for tag, content in parts)


def markers(times: FloatArray, channels: str = POINT) -> Stream:
    return Stream("MoCap", channels, times, width=3)


def even(start: float = BEGIN, rate: float = RATE, count: int = COUNT) -> FloatArray:
    return start + np.arange(count) / rate


def write(path: Path, *streams: Stream) -> Path:
    head = b"<info><version>1.0</version></info>"
    content = b"".join(stream.chunks(number) for number, stream in enumerate(streams, 1))
    path.write_bytes(b"XDF:" + struct.pack("<BQH", 8, 2 + len(head), 1) + head + content)
    return path


def test_an_exported_run_is_read_back_with_every_value(trial: C3dTrial, tmp_path: Path) -> None:
    write_xdf(tmp_path / "run.xdf", trial)
    found = read_trial(tmp_path / "run.xdf")
    assert (found.labels, found.rate, found.start) == (trial.labels, trial.rate, trial.start)
    assert found.analog_rate == trial.rate * trial.per_frame and found.up == trial.up
    y_up = found.positions @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    assert np.array_equal(y_up, trial.positions, equal_nan=True)
    assert [(label, unit) for label, unit in zip(found.channels, found.units, strict=True)] == [
        (channel.label, channel.unit) for channel in trial.channels
    ]
    assert np.array_equal(found.analogs.T, [channel.values for channel in trial.channels])
    ((time, *words),) = found.events
    assert words == ["Foot Strike", "Left"] and time == pytest.approx(0.1, abs=1e-12)


def test_an_exported_run_is_the_same_as_c3d_and_as_xdf(trial: C3dTrial, tmp_path: Path) -> None:
    write_xdf(tmp_path / "run.xdf", trial)
    c3d_format.write(trial, tmp_path / "run.c3d")
    xdf, c3d = (read_trial(tmp_path / f"run.{ending}") for ending in ("xdf", "c3d"))
    assert np.abs(np.nan_to_num(xdf.positions - c3d.positions)).max() < 1e-6
    np.testing.assert_allclose(xdf.plate(1).T_lab_plate, c3d.plate(1).T_lab_plate, atol=1e-6)
    np.testing.assert_allclose(xdf.plate(1).load, c3d.plate(1).load, atol=1e-3)


def test_the_emulated_devices_replay_an_xdf_file(trial: C3dTrial, tmp_path: Path) -> None:
    write_xdf(path := tmp_path / "run.xdf", trial)
    emg = RecordedEmg(str(path), "", ("biceps",), 1.0).replayed(("biceps",))
    at = 1.0 + np.arange(5) / (trial.rate * trial.per_frame)
    np.testing.assert_allclose(emg.at(at)[:, 0], trial.channels[6].values[:5], atol=1e-12)
    assert RecordedLoad(str(path), "", 1, 1.0).replayed().at(at).shape == (5, 6)


def test_clocks_of_streams_are_put_on_that_of_the_file(tmp_path: Path) -> None:
    behind = tuple((BEGIN - 100.0 + at, 100.0) for at in (0.0, 1.0, 2.0))
    emg = Stream("EMG", VOLT, even(BEGIN - 100.0 + 0.5, 1000.0, 1000), 1000.0, behind)
    found = read(write(tmp_path / "a.xdf", markers(even()), emg))
    assert found.labels == ("A",) and found.positions[0, 0] == pytest.approx([0.05, 0.05, 0.05])  # frame 50, in mm
    assert (len(found.positions), found.analog_rate, found.analogs[0, 0]) == (100, 1000.0, 0.0)
    assert found.volts(["RBIC"])[3, 0] == pytest.approx(3e-6)
    assert found.left_out == ("100 frames, in which not all streams have samples",) and not found.up_known


@pytest.mark.parametrize(
    ("spoiled", "reason"),
    [
        ({"rate": 0.0}, "has 2000 samples at 0 Hz; valid: two or more, at an even rate"),
        ({"rate": 900.0}, "has a nominal rate of 900 Hz, and 1000 samples per second"),
        ({"offsets": ()}, "has no clock offsets, so that it may be on another clock"),
        ({"stated": 1999}, "has 2000 samples; its footer states 1999"),
        ({"times": np.delete(even(BEGIN, 1000.0, 2100), slice(1000, 1100))}, "is not even in time"),
        (
            {"offsets": tuple((BEGIN + 5.0 * k + 40.0 * (k > 9), 60.0 * (k > 9)) for k in range(20))},
            "has 2 parts, since its clock was reset during the recording",
        ),
    ],
)  # fmt: skip
def test_a_spoiled_stream_costs_itself(spoiled: dict[str, object], reason: str, tmp_path: Path) -> None:
    rate = 14.0 if spoiled.get("offsets") else 1000.0  # the clock was set again in a long recording
    emg = replace(Stream("EMG", VOLT, even(BEGIN, rate, 2000), rate), **spoiled)  # type: ignore[arg-type]
    found = read_trial(write(tmp_path / "a.xdf", markers(even()), emg))
    assert len(found.positions) == COUNT and found.channels == ()
    assert found.left_out[0].startswith(f"stream EMG 2, which {reason}")


def test_markers_that_are_not_even_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xdf", markers(np.delete(even(), slice(50, 60))))
    with pytest.raises(HricError, match=r"a.xdf: stream MoCap 1 is not even in time: a sample is \d\.\d periods off"):
        read_trial(path)


def test_positions_without_a_unit_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xdf", markers(even(), POINT.replace("<unit>millimeters</unit>", "")))
    with pytest.raises(HricError, match="A_X is in 'no unit'; valid: mm, cm"):
        read_trial(path)


def test_emg_without_a_unit_has_no_volts(tmp_path: Path) -> None:
    channel = VOLT.replace("<unit>microvolts</unit>", "")
    found = read_trial(write(tmp_path / "a.xdf", Stream("EMG", channel, even())))
    with pytest.raises(HricError, match=r"channel RBIC of a.xdf is in 'no unit'; valid: V, mV, uV"):
        found.volts(["RBIC"])


def test_force_without_the_place_of_the_plate_is_a_channel_only(tmp_path: Path) -> None:
    force = Stream("Force", "<channel><label>Fz1</label><unit>newtons</unit></channel>", even())
    found = read_trial(write(tmp_path / "a.xdf", markers(even()), force))
    assert (found.channels, found.units, dict(found.plates)) == (("Fz1",), ("N",), {})
    assert "does not state where they are" in found.left_out[0]


def test_a_header_of_an_export_with_another_axis_is_refused(trial: C3dTrial, tmp_path: Path) -> None:
    write_xdf(path := tmp_path / "run.xdf", trial)
    path.write_bytes(path.read_bytes().replace(b'"up": "y"', b'"up": "x"'))
    with pytest.raises(HricError, match="is damaged: its header states no valid axis or unit of length"):
        read_trial(path)


@pytest.mark.parametrize("content", [b"", b"XDF:", b"no xdf", b"XDF:" + bytes(range(200))])
def test_files_of_another_content_are_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.xdf").write_bytes(content)
    with pytest.raises(HricError, match=r"^xdf file .*a.xdf"):
        read_trial(tmp_path / "a.xdf")


def test_a_file_that_ends_anywhere_is_refused_or_keeps_what_is_sound(tmp_path: Path) -> None:
    path = write(tmp_path / "a.xdf", markers(even()), Stream("EMG", VOLT, even()))
    sound = path.read_bytes()
    for end in range(1, len(sound), 97):
        path.write_bytes(sound[:end])
        try:
            found = read_trial(path)
        except HricError:
            continue
        assert len(found.positions) in (0, COUNT) and len(found.analogs) in (0, COUNT)
