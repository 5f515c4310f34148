"""Emulated EMG over a real LSL outlet, read by the real inlet: stamps, numbers, restarts."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from ipaddress import ip_address
from pathlib import Path

import numpy as np
import pytest

from hric_core.errors import ParameterError
from hric_core.robot_time.stream_time import WallClock
from hric_perception.chunk import Chunk, Layout
from hric_perception.emg.muscles import PROGRAM, EmulatedMuscles
from hric_perception.emulation import Emulator, EvenSensor, Faults
from hric_perception.lsl import LslOutlet, LslReader, StreamQuery, use_session
from hric_perception.stream import ERROR, START, WARN, SampleStream, StreamHealth

pytestmark = pytest.mark.alone

use_session(f"test_lsl_{os.getpid()}")
LIMIT = 30.0
NAMES = tuple("abcdefgh")


def wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


class Offset(WallClock):
    """A run whose time 0 was when the test began."""

    def __init__(self) -> None:
        self.zero = time.monotonic_ns()

    def now(self) -> float:
        return 1e-9 * (time.monotonic_ns() - self.zero)

    def monotonic(self, run: float) -> int:
        return round(1e9 * run) + self.zero

    def robot_time(self, monotonic: int) -> float | None:
        return 1e-9 * (monotonic - self.zero)


class Rig:
    """An emulated device and its reader."""

    def __init__(self, name: str) -> None:
        self.clock, self.name = Offset(), name
        self.chunks: list[Chunk] = []
        self.health = StreamHealth("lsl")
        stream = SampleStream(self.clock.robot_time, self.health, self.chunks.append)
        self.reader = LslReader(StreamQuery("EMG", name), stream, self.health)
        self.reader.start()

    def device(self, rate: float = 2000.0, faults: Faults | None = None) -> tuple[Emulator, EvenSensor]:
        faults = faults or Faults(time_code=True)
        muscles = EmulatedMuscles(PROGRAM.checked({}, "activation").activation(len(NAMES)), len(NAMES), rate)
        sensor = EvenSensor(rate, len(NAMES), muscles, faults)
        outlet = LslOutlet(Layout(self.name, (*NAMES, "time"), ("V",) * 8 + ("s",), rate), "EMG", self.name)
        return Emulator(sensor, outlet, self.clock), sensor


@pytest.fixture
def rig(request: pytest.FixtureRequest):
    made = Rig(request.node.name)
    yield made
    made.reader.close()


def worst(chunks: list[Chunk]) -> float:
    """Largest difference between stamps and time codes [s]."""
    return max(float(np.abs(chunk.times - chunk.data[:, -1]).max()) for chunk in chunks)


def numbers(chunks: list[Chunk]) -> np.ndarray:
    return np.concatenate([np.arange(chunk.first, chunk.after) for chunk in chunks])


def codes(chunks: list[Chunk]) -> np.ndarray:
    return np.concatenate([chunk.data[:, -1] for chunk in chunks])


def own_sockets() -> list[tuple[str, int]]:
    """Local address and port of each IP socket of this process, as the system lists them: a second Python socket on a
    file would make it non-blocking for its owner, too."""
    files = {os.path.realpath(f"/proc/self/fd/{file}") for file in os.listdir("/proc/self/fd")}
    bound = []
    for table in ("tcp", "udp", "tcp6", "udp6"):
        for line in Path(f"/proc/self/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if any(file.endswith(f"socket:[{fields[9]}]") for file in files):
                address, port = fields[1].split(":")
                words = [bytes.fromhex(address[k : k + 8])[::-1] for k in range(0, len(address), 8)]
                bound.append((str(ip_address(b"".join(words))), int(port, 16)))
    return bound


def test_every_socket_of_a_session_is_on_loopback(rig: Rig) -> None:
    device, _ = rig.device()
    device.start()
    wait(lambda: rig.chunks)
    bound = own_sockets()
    device.close()
    assert len(bound) > 4
    assert [(host, port) for host, port in bound if port and not ip_address(host).is_loopback] == []


def test_stamps_are_the_times_of_the_samples_and_none_is_missing(rig: Rig) -> None:
    device, sensor = rig.device()
    time.sleep(0.2)
    device.start()
    wait(lambda: rig.health.samples > 6000)
    device.close()
    sent = sensor.sent
    wait(lambda: rig.health.samples >= sent or rig.health.report().level == ERROR)
    assert worst(rig.chunks) < 2e-4
    assert rig.chunks[0].layout.channels == (*NAMES, "time") and rig.chunks[0].layout.unit == "V V V V V V V V s"
    assert np.allclose(np.diff(codes(rig.chunks)), 1 / 2000) and (np.diff(numbers(rig.chunks)) == 1).all()
    assert rig.health.lost == 0


FAR = """
import sys, time, pylsl
from hric_perception.lsl import use_session
use_session(sys.argv[1])
outlet = pylsl.StreamOutlet(pylsl.StreamInfo(sys.argv[2], "EMG", 1, 100.0, pylsl.cf_double64, "far"))
while True:
    outlet.push_sample([0.0], pylsl.local_clock())
    time.sleep(0.01)
"""
"""Program with an LSL outlet, for a process with a clock of its own."""
AHEAD = ("unshare", "--time", "--monotonic", "100000")
"""Command that runs a program whose monotonic clock is 100000 s ahead."""


def test_another_clock_on_the_same_host_name_is_corrected(rig: Rig) -> None:
    if shutil.which(AHEAD[0]) is None or subprocess.run([*AHEAD, "true"], capture_output=True).returncode:
        pytest.skip("this user may not give a process a clock of its own")
    words = [*AHEAD, sys.executable, "-c", FAR, f"test_lsl_{os.getpid()}", rig.name]
    with subprocess.Popen(words) as device:
        try:
            wait(lambda: rig.health.samples > 300)
        finally:
            device.kill()
    now = rig.clock.now()
    assert all(0.0 < chunk.start < now for chunk in rig.chunks)


def test_a_drop_out_shows_in_the_numbers_and_not_in_the_stamps(rig: Rig) -> None:
    device, sensor = rig.device(faults=Faults(time_code=True, dropouts=((2.0, 0.3),), not_finite=((2.6, 0.01),)))
    device.start()
    wait(lambda: rig.chunks and rig.chunks[-1].start > 3.0)
    device.close()
    assert worst(rig.chunks) < 2e-4
    steps = np.diff(numbers(rig.chunks))
    assert sorted(set(steps.tolist())) == [1, 601] and rig.health.lost == 600 == sensor.dropped
    assert rig.health.not_finite == 20
    assert "600 samples lost" in rig.health.report().text and "not finite: a" in rig.health.report().text


def test_a_device_that_dies_is_reported_and_found_again_with_another_rate(rig: Rig) -> None:
    device, _ = rig.device()
    device.start()
    wait(lambda: rig.health.samples > 1000)
    device.close()
    del device
    wait(lambda: rig.health.report().level == ERROR)
    again, _ = rig.device(rate=1000.0)
    again.start()
    wait(lambda: rig.chunks[-1].layout.rate == 1000.0 and rig.chunks[-1].first > 1000)
    again.close()
    late = [chunk for chunk in rig.chunks if chunk.layout.rate == 1000.0]
    assert worst(late) < 2e-4 and late[0].first == 0
    assert "the rate changed from 2000 to 1000 Hz" in rig.health.report().text and rig.health.begun == 2


def test_the_requested_stream_must_be_named() -> None:
    with pytest.raises(ParameterError, match="valid: a type, a name or a source_id"):
        StreamQuery()
    with pytest.raises(ParameterError, match="quotation"):
        StreamQuery("EMG", "it's")
    with pytest.raises(ParameterError, match="session"):
        use_session("a b")


def test_a_stream_that_is_not_there_yet_is_waited_for_and_an_error_when_all_nodes_had_time_to_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    health, now = StreamHealth("a stream by lsl"), time.monotonic()
    assert health.report()[:2] == (WARN, "waiting for a stream by lsl")
    monkeypatch.setattr(time, "monotonic", lambda: now + START + 1.0)
    assert health.report()[:2] == (ERROR, "waiting for a stream by lsl")
