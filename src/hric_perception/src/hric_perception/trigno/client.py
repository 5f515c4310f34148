"""Reads EMG from a Trigno server, and connects again when it was lost. No ROS."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
import time
from dataclasses import dataclass

import numpy as np

from hric_perception.chunk import Layout
from hric_perception.health import StreamHealth
from hric_perception.stream import SampleStream
from hric_perception.trigno import protocol

LOG = logging.getLogger("hric.perception.trigno")
TIMEOUT = 2.0
"""For an answer [s]; the constants of this file are our choice."""
AGAIN = 0.5
"""Between attempts to connect [s]."""
IDLE = 0.1
"""Longest wait, after which a request to end is noticed [s]."""
BUFFER = 1 << 16
"""Bytes read at once."""


@dataclass(frozen=True)
class Settings:
    """Where the server is.

    Args:
        host: address.
        command_port, data_port: TCP.
        channels: names of the first sensors; a channel named `time` carries a time code [s].
        rate: of a server that does not tell it [Hz].
        latency: least time from a sample to its arrival here [s].
    """

    host: str = "127.0.0.1"
    command_port: int = protocol.COMMAND_PORT
    data_port: int = protocol.EMG_PORT
    channels: tuple[str, ...] = tuple(f"emg{number}" for number in range(1, protocol.CHANNELS + 1))
    rate: float = protocol.RATE
    latency: float = 0.0


class TrignoClient:
    """Reads in a thread of its own from `start` on. Use `close`.

    Args:
        settings: where the server is.
        stream: gets the samples.
        health: is told of trouble.
    """

    def __init__(self, settings: Settings, stream: SampleStream, health: StreamHealth) -> None:
        self._settings, self._stream, self._health = settings, stream, health
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="trigno client", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join(TIMEOUT + 1.0)

    def _run(self) -> None:
        settings = self._settings
        where = f"the Trigno server at {settings.host}:{settings.command_port}"
        while not self._stop.is_set():
            try:
                self._converse()
            except (OSError, ValueError) as error:
                text = getattr(error, "strerror", None) or error
                self._health.trouble(f"{where} (data port {settings.data_port}): {text}")
                LOG.warning("%s: %s", where, text)
            self._stream.end()
            self._stop.wait(AGAIN)

    def _converse(self) -> None:
        settings = self._settings
        with (
            socket.create_connection((settings.host, settings.command_port), TIMEOUT) as command,
            socket.create_connection((settings.host, settings.data_port), TIMEOUT) as data,
        ):
            _answer(command)  # the greeting
            rate = _rate(command) or settings.rate
            units = tuple("s" if name == "time" else "V" for name in settings.channels)
            layout = Layout(protocol.trigno_name(settings.host, settings.data_port), settings.channels, units, rate)
            data.settimeout(IDLE)
            if (answer := _ask(command, "START")) != "OK":
                raise ValueError(f"START is answered by {answer!r}")
            self._stream.begin(layout, settings.latency)
            LOG.info("%s at %g Hz", layout.source, rate)
            try:
                self._read(data)
            finally:
                with contextlib.suppress(OSError):
                    _ask(command, "STOP")

    def _read(self, data: socket.socket) -> None:
        rest, columns = b"", len(self._settings.channels)
        while not self._stop.is_set():
            try:
                got = data.recv(BUFFER)
            except TimeoutError:
                continue
            now = time.monotonic()
            if not got:
                raise ConnectionResetError("the connection was closed")
            rest += got
            whole = len(rest) - len(rest) % protocol.SAMPLE_SIZE
            samples = np.frombuffer(rest[:whole], protocol.SAMPLE).reshape(-1, protocol.CHANNELS)
            rest = rest[whole:]
            self._stream.arrived(now, samples[:, :columns].astype(float))


def _rate(command: socket.socket) -> float | None:
    """Of a server that tells it [Hz]."""
    try:
        interval, count = float(_ask(command, protocol.FRAME_INTERVAL)), int(_ask(command, protocol.FRAME_COUNT))
    except ValueError:
        return None
    return count / interval if interval > 0 and count > 0 else None


def _ask(command: socket.socket, word: str) -> str:
    command.sendall(word.encode() + protocol.END)
    return _answer(command)


def _answer(command: socket.socket) -> str:
    heard = b""
    while not heard.endswith(protocol.END):
        data = command.recv(4096)
        if not data:
            raise ConnectionResetError("the connection was closed")
        heard += data
    return heard.decode(errors="replace").strip()
