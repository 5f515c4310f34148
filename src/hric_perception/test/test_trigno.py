"""The Trigno client against the emulated server, over TCP on loopback."""

import contextlib
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from hric_core.errors import HricError
from hric_core.robot_time.stream_time import WallClock
from hric_perception.chunk import Chunk
from hric_perception.emulation import Emulator, EvenSensor, Faults
from hric_perception.stream import ERROR, OK, SampleStream, StreamHealth
from hric_perception.trigno import client, protocol
from hric_perception.trigno.client import TrignoClient, TrignoSettings
from hric_perception.trigno.server import MAX_CLIENTS, TrignoServer

pytestmark = pytest.mark.alone

LIMIT = 30.0
BOUND = 0.0135
"""Latency declared for the stamps: one frame [s]."""


def wait(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def device(server: TrignoServer, rate: float) -> Emulator:
    """Return an emulated device whose first channel counts its samples."""

    def count(first: int, times: np.ndarray) -> np.ndarray:
        return ((first + np.arange(len(times))) % 10000)[:, None].astype(float)

    return Emulator(EvenSensor(rate, 1, count, Faults(time_code=True)), server, WallClock())


class Reader:
    def __init__(self, command_port: int, data_port: int) -> None:
        self.chunks: list[Chunk] = []
        self.health = StreamHealth("trigno")
        stream = SampleStream(lambda monotonic: 1e-9 * monotonic, self.health, self.chunks.append)
        settings = TrignoSettings(
            command_port=command_port, data_port=data_port, channels=("count", "time"), rate=1000.0
        )
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


@pytest.mark.parametrize(
    ("word", "answer"),
    [
        ("SENSOR 1 PAIRED?", "YES"),
        ("SENSOR 16 TYPE?", "O"),
        ("SENSOR 3 CHANNEL 1 RATE?", "2000"),
        ("SENSOR 17 PAIRED?", "INVALID COMMAND"),
        ("SENSOR 1 CHANNEL 2 RATE?", "INVALID COMMAND"),
        ("SENSOR 1 SERIAL?", "INVALID COMMAND"),
    ],
)
def test_base_station_answers_about_its_sensors(server: TrignoServer, word: str, answer: str) -> None:
    with socket.create_connection(("127.0.0.1", server.command_port), timeout=LIMIT) as connection:
        file = connection.makefile("rwb")
        assert file.read(len(protocol.GREETING)) == protocol.GREETING
        file.write(word.encode() + protocol.END)
        file.flush()
        assert file.read(len(answer) + len(protocol.END)) == answer.encode() + protocol.END


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
        with pytest.raises(ValueError, match=r"a response did not end within 4096 bytes and 0\.3 s"):
            client._response(ours)
    finally:
        ended.set()
        feeder.join()
        ours.close()
        theirs.close()


# -- rubbish -----------------------------------------------------------------------------------------------------------

of_any_bytes = pytest.mark.filterwarnings("ignore:invalid value encountered in cast")  # numpy says so of some NaN
SPOILT = (
    "",
    "nan",
    "inf",
    "-1",
    "0",
    "1e-320",
    "9" * 400,
    "0.0135",
    "OK",
    "INVALID COMMAND",
    "\x00\xff",
    "OK\r\n\r\nOK",
)


@pytest.mark.parametrize("interval, count", [("0.0135", "9" * 400), ("1e-320", "27"), ("nan", "27"), ("1e9", "27")])
def test_a_rate_that_no_server_has_is_trouble_that_is_named_and_the_reading_goes_on(
    interval: str, count: str, server: TrignoServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "AGAIN", 0.01)
    known = server._response
    answers = {protocol.FRAME_INTERVAL: interval, protocol.FRAME_COUNT: count}
    monkeypatch.setattr(server, "_response", lambda word: answers.get(word) or known(word))
    reader, source = Reader(server.command_port, server.data_port), device(server, 2000.0)
    source.start()
    wait(lambda: "reports a rate of" in reader.health.report().text)
    assert reader.health.samples == 0
    answers.clear()
    wait(lambda: reader.health.samples)
    reader.client.close()
    source.close()


@of_any_bytes
def test_two_hundred_spoilt_conversations_leave_a_client_that_reads_the_next_server(
    server: TrignoServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "AGAIN", 0.0)
    monkeypatch.setattr(client, "TIMEOUT", 0.02)
    drawn, known, conversations = random.Random(7), server._response, 0

    def spoilt(word: str) -> str:
        """Return an answer that is right, of another question, or noise; noise for samples goes with it."""
        nonlocal conversations
        conversations += word == protocol.FRAME_INTERVAL
        if conversations > 200:  # a whole conversation is spoilt or none of it: the rate is asked before START
            return known(word)
        with server._lock:
            server._send(drawn.randbytes(drawn.randrange(1, 3000)))
        return known(word) if drawn.random() < 0.4 else drawn.choice((*SPOILT, drawn.randbytes(30).decode("latin-1")))

    def ended() -> bool:
        """Return True after two hundred; until then whoever gets samples is hung up on."""
        with server._lock:
            while conversations <= 200 and server._listeners:
                server._listeners.pop().close()
        return conversations > 200

    monkeypatch.setattr(server, "_response", spoilt)
    reader = Reader(server.command_port, server.data_port)
    source = device(server, 2000.0)
    source.start()
    wait(ended)
    monkeypatch.setattr(client, "TIMEOUT", 2.0)
    before = reader.health.samples
    wait(lambda: reader.health.samples > before + 500 and reader.chunks[-1].layout.rate == pytest.approx(2000.0))
    reader.client.close()
    source.close()


@of_any_bytes
def test_random_bytes_in_random_pieces_are_as_many_samples_as_fit_and_none_twice() -> None:
    drawn = random.Random(8)
    for _ in range(200):
        sent = drawn.randbytes(drawn.randrange(4000))
        decoder, decoded, at = protocol.Decoder(protocol.CHANNELS), [], 0
        while at < len(sent):
            size = drawn.randrange(1, 400)
            decoded.append(decoder.decode(sent[at : at + size]))
            at += size
        whole = np.frombuffer(sent[: len(sent) // protocol.SAMPLE_SIZE * protocol.SAMPLE_SIZE], "<f4").astype(float)
        assert np.array_equal(np.concatenate([*decoded, np.empty((0, 16))]).ravel(), whole, equal_nan=True)


def started(server: TrignoServer) -> tuple[socket.socket, socket.socket]:
    """Return the command and data connections of a client that has started the samples."""
    command = socket.create_connection(("127.0.0.1", server.command_port), 5.0)
    data = socket.create_connection(("127.0.0.1", server.data_port), 5.0)
    command.sendall(b"START" + protocol.END)
    wait(lambda: server._listeners and b"OK" in command.recv(4096))
    return command, data


def test_a_connection_that_comes_and_goes_stops_no_samples(server: TrignoServer) -> None:
    command, data = started(server)
    with socket.create_connection(("127.0.0.1", server.command_port), 5.0) as passer:
        assert passer.recv(4096)
    wait(lambda: len(server._clients) == 1)
    server.push(np.zeros(0), np.zeros((270, 2)))
    assert data.recv(64)
    command.close()
    wait(lambda: not server._clients)
    assert server._starter is None


def test_a_client_that_reads_nothing_delays_nobody_and_is_closed(
    server: TrignoServer, caplog: pytest.LogCaptureFixture
) -> None:
    command, data = started(server)
    samples, slowest = np.zeros((27 * 400, 2)), 0.0
    for _ in range(100):
        begin = time.monotonic()
        server.push(np.zeros(0), samples)
        slowest = max(slowest, time.monotonic() - begin)
    assert slowest < 0.5 and not server._listeners
    assert "reads its samples too slowly" in caplog.text
    command.close(), data.close()


def test_a_crowd_and_an_endless_command_cost_a_bounded_number_of_threads_and_bytes(server: TrignoServer) -> None:
    before, address = threading.active_count(), ("127.0.0.1", server.command_port)
    with contextlib.ExitStack() as stack:
        for _ in range(100):
            stack.enter_context(socket.create_connection(address, 5.0))
        wait(lambda: len(server._clients) == MAX_CLIENTS)
        assert threading.active_count() - before <= MAX_CLIENTS
    wait(lambda: not server._clients)
    with socket.create_connection(address, 5.0) as endless, pytest.raises(OSError):
        for _ in range(1000):
            endless.sendall(bytes(1 << 16))
