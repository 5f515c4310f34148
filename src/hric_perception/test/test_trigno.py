"""The Trigno client against the emulated server, over TCP on loopback."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from hric_control.errors import HricError
from hric_control.robot_time.stream_time import WallClock
from hric_perception.chunk import Chunk
from hric_perception.emulation import Emulator, EvenSensor, Faults
from hric_perception.stream import ERROR, OK, SampleStream, StreamHealth
from hric_perception.trigno import client, protocol
from hric_perception.trigno.client import Settings, TrignoClient
from hric_perception.trigno.server import TrignoServer

pytestmark = pytest.mark.alone

LIMIT = 30.0
BOUND = 0.0135
"""Declared for the stamps: one frame [s]; see INTERFACE.md."""


def wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def device(server: TrignoServer, rate: float) -> Emulator:
    """Counts samples in the first channel."""

    def count(first: int, times: np.ndarray) -> np.ndarray:
        return ((first + np.arange(len(times))) % 10000)[:, None].astype(float)

    return Emulator(EvenSensor(rate, 1, count, Faults(time_code=True)), server, WallClock())


class Reader:
    def __init__(self, command_port: int, data_port: int) -> None:
        self.chunks: list[Chunk] = []
        self.health = StreamHealth("trigno")
        stream = SampleStream(lambda monotonic: 1e-9 * monotonic, self.health, self.chunks.append)
        settings = Settings(command_port=command_port, data_port=data_port, channels=("count", "time"), rate=1000.0)
        self.client = TrignoClient(settings, stream, self.health)
        self.client.start()


@pytest.fixture
def server() -> Iterator[TrignoServer]:
    made = TrignoServer(2000.0, time_code=True)
    made.start()
    yield made
    made.close()


def test_every_sample_arrives_with_a_stamp_within_the_declared_bound(server: TrignoServer) -> None:
    reader, source = Reader(server.command_port, server.data_port), device(server, 2000.0)
    source.start()
    wait(lambda: reader.health.samples > 5000)
    assert reader.health.report().level == OK
    reader.client.close()
    source.close()
    data = np.concatenate([chunk.data for chunk in reader.chunks])
    times = np.concatenate([chunk.times for chunk in reader.chunks])
    assert set(np.diff(data[:, 0]).tolist()) <= {1.0, -9999.0}
    assert reader.chunks[0].layout.rate == pytest.approx(2000.0) and reader.health.lost == 0
    off = (times - data[:, 1] + 0.5) % 1.0 - 0.5
    assert np.abs(off[2000:]).max() < BOUND


def test_a_server_that_dies_and_comes_back_with_another_rate_is_reported_and_found(server: TrignoServer) -> None:
    reader, source = Reader(server.command_port, server.data_port), device(server, 2000.0)
    source.start()
    wait(lambda: reader.health.samples > 500)
    source.close()
    wait(lambda: reader.health.report().level == ERROR)
    other = TrignoServer(1000.0, command_port=server.command_port, data_port=server.data_port, time_code=True)
    other.start()
    again = device(other, 1000.0)
    again.start()
    wait(lambda: reader.chunks[-1].layout.rate == pytest.approx(1000.0, rel=1e-3))
    assert "the rate changed from 2000 to 1000 Hz" in reader.health.report().text
    again.close()
    reader.client.close()


def test_a_server_that_is_not_there_is_named() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(HricError, match=f"cannot listen on 127.0.0.1, TCP port {port}"):
            TrignoServer(2000.0, command_port=port)
    reader = Reader(port, port)
    wait(lambda: f"the Trigno server at 127.0.0.1:{port}" in reader.health.report().text)
    reader.client.close()


def test_an_older_server_has_the_rate_of_the_parameter(server: TrignoServer, monkeypatch: pytest.MonkeyPatch) -> None:
    known = server._response
    monkeypatch.setattr(
        server, "_response", lambda word: "INVALID COMMAND" if word == protocol.FRAME_COUNT else known(word)
    )
    reader, source = Reader(server.command_port, server.data_port), device(server, 2000.0)
    source.start()
    wait(lambda: reader.chunks)
    assert reader.chunks[0].layout.rate == 1000.0
    reader.client.close()
    source.close()


@pytest.mark.parametrize("sent", [b"x" * 100_000, b"a"], ids=["a flood", "a drip"])
def test_a_response_without_an_end_is_given_up_with_a_reason(sent: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "TIMEOUT", 0.3)
    ours, theirs = socket.socketpair()
    ours.settimeout(0.3)
    ended = threading.Event()

    def feed() -> None:
        while not ended.wait(0.02):
            with contextlib.suppress(OSError):
                theirs.send(sent, socket.MSG_DONTWAIT)

    feeder = threading.Thread(target=feed)
    feeder.start()
    try:
        with pytest.raises(ValueError, match=r"no end of a response within 4096 bytes and 0\.3 s"):
            client._response(ours)
    finally:
        ended.set()
        feeder.join()
        ours.close()
        theirs.close()
