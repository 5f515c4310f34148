"""The emulated Motive in robot time: its stream pauses with the run, while its own clock continues."""

import sys
import time
from pathlib import Path

import pytest
from real_master import free_port

from hric_core.robot_time.clock import NS, RunClock
from hric_core.robot_time.stream_time import StreamTime
from mocap_natnet.client import ClientSettings as ClientSettings
from mocap_natnet.client import NatNetClient, Received
from mocap_natnet.server import Motive, MotiveServer, MotiveSettings, SceneBody, ServedScene, SinusoidSource

sys.path.insert(0, str(Path(__file__).parent))

pytestmark = pytest.mark.alone

LIMIT = 20.0


class PacedRun:
    """Run whose pace the test sets; whenever the time is requested, it passes clock pairs to the clock."""

    def __init__(self, pace: float) -> None:
        self.pace, self._clock = pace, RunClock()
        self._at, self._time = time.monotonic_ns(), 5.0

    def _tell(self) -> int:
        now = time.monotonic_ns()
        self._time += self.pace * (now - self._at) / NS
        self._at = now
        self._clock.add(now, self._time, self.pace or 1.0)
        return now

    def now(self) -> float | None:
        return self._clock.robot_time(self._tell())

    def monotonic(self, run: float) -> int | None:
        return self._clock.monotonic(run)


def test_frames_come_at_the_pace_of_the_run_and_their_ticks_give_when_that_was() -> None:
    run, ports = PacedRun(0.5), (free_port(), free_port())
    motive = Motive(
        MotiveSettings(transport="unicast", rate=200.0, command_port=ports[0], data_port=ports[1]),
        ServedScene((SceneBody("marker", SinusoidSource()),)),
    )
    frames: list[Received] = []
    with (
        MotiveServer(motive, run) as server,
        NatNetClient(ClientSettings(command_port=ports[0]), frames.append) as client,
    ):
        _wait(lambda: len(frames) > 200)
        run.pace = 0.0
        time.sleep(1.0)
        stood, echoes = len(frames), client.session.last_response
        time.sleep(0.3)
        assert len(frames) == stood, "a paused run has no frames"
        assert client.session.last_response != echoes, "Motive answers all the same"
        run.pace = 0.5
        _wait(lambda: len(frames) > stood + 100)
        assert client.session.statistics.lost == 0 and server.time > 0
    exact = [frame for frame in frames[50:200] if frame.means == "mid-exposure"]
    passed, exposures = (exact[-1].exposed - exact[0].exposed) / NS, exact[-1].frame.number - exact[0].frame.number
    assert exposures / 200.0 / passed == pytest.approx(0.5, abs=0.02)


def test_a_stream_whose_frames_take_long_leaves_none_out(caplog: pytest.LogCaptureFixture) -> None:
    settings = MotiveSettings(transport="unicast", rate=100.0, latency=1.3, command_port=0, data_port=free_port())
    with MotiveServer(Motive(settings, ServedScene((SceneBody("marker", SinusoidSource()),)))) as server:
        begin = time.monotonic()
        _wait(lambda: server.sent > 20)
        latest, sent = server.progress
    assert latest == sent - 1 and time.monotonic() - begin > 1.4
    assert not caplog.records, "a latency is no delay"


class GivenTime:
    """Clock whose time the test sets."""

    def __init__(self) -> None:
        self.time: float | None = None

    def now(self) -> float | None:
        return self.time

    def monotonic(self, run: float) -> int | None:
        return None


def test_the_stream_begins_when_the_time_is_known_never_goes_back_and_goes_on_in_another_run() -> None:
    clock = GivenTime()
    stream = StreamTime(clock)
    assert stream.now() == 0.0
    for shown, wanted in ((100.0, 0.0), (102.0, 2.0), (101.9, 2.0), (102.5, 2.5), (0.5, 2.5), (1.5, 3.5)):
        clock.time = shown
        assert stream.now() == pytest.approx(wanted)


def _wait(condition: object) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.01)
