"""Driver that reads EMG from a Trigno server, and reconnects after a lost connection. No ROS."""

import contextlib
import logging
import socket
import time
from dataclasses import dataclass

from hric_core.parameters import Settings as Base
from hric_core.parameters import names, number, text, whole
from hric_perception.chunk import Layout
from hric_perception.stream import Driver, SampleStream, StreamHealth
from hric_perception.trigno import protocol

LOG = logging.getLogger("hric.perception.trigno")
TIMEOUT = 2.0
"""Time-out of a response [s]; the constants of this file are project defaults, unconfirmed."""
MAX_RESPONSE = 4096
"""Longest accepted response to a command [B]; valid ones have one line."""
AGAIN = 0.5
"""Time between attempts to connect to the Trigno server [s]."""
IDLE = 0.1
"""Longest time until the thread notices that it is to end [s]."""
BUFFER = 1 << 16
"""Largest number of bytes read at once."""
RATES = 1.0, 1e5
"""Lowest and highest sample rate accepted from a server [Hz]."""


@dataclass(frozen=True)
class TrignoSettings(Base):
    """Parameters of the connection to a Trigno server: address and EMG channels."""

    host: str = text("127.0.0.1", empty=False, text="address of the Trigno server")
    command_port: int = whole(protocol.COMMAND_PORT, minimum=1, maximum=65535, text="TCP port of commands")
    data_port: int = whole(protocol.EMG_PORT, minimum=1, maximum=65535, text="TCP port of EMG data")
    channels: tuple[str, ...] = names(
        range(1, protocol.CHANNELS + 1),
        tuple(f"emg{index}" for index in range(1, protocol.CHANNELS + 1)),
        text="names of the first sensors; a channel named `time` has a time code [s]",
    )
    rate: float = number(
        protocol.RATE,
        minimum=RATES[0],
        maximum=RATES[1],
        unit="Hz",
        text="sample rate of a server that does not report it",
    )
    latency: float = number(
        0.0, minimum=0.0, maximum=1.0, unit="s", text="minimum time from a sample to its arrival here"
    )

    def layout(self, rate: float) -> Layout:
        """Return the layout of the server's samples at a sample rate [Hz]."""
        units = tuple("s" if name == "time" else "V" for name in self.channels)
        return Layout(protocol.trigno_name(self.host, self.data_port), self.channels, units, rate)


class TrignoClient(Driver):
    """Driver that reads EMG from a Trigno server, and reconnects after a lost connection.

    Args:
        settings: address and channels of the server.
        stream: receiver of the samples.
        health: receiver of status reports.
    """

    def __init__(self, settings: TrignoSettings, stream: SampleStream, health: StreamHealth) -> None:
        super().__init__("trigno client", TIMEOUT + 1.0)
        self._settings, self._stream, self._health = settings, stream, health

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
            _response(command)  # the greeting
            layout = settings.layout(_rate(command) or settings.rate)
            data.settimeout(IDLE)
            if (response := _request(command, "START")) != "OK":
                raise ValueError(f"the response to START is {response!r}; expected: 'OK'")
            self._stream.begin(layout, settings.latency)
            LOG.info("%s at %g Hz", layout.source, layout.rate)
            try:
                self._read(data)
            finally:
                with contextlib.suppress(OSError):
                    _request(command, "STOP")

    def _read(self, data: socket.socket) -> None:
        decoder = protocol.Decoder(len(self._settings.channels))
        while not self._stop.is_set():
            try:
                got = data.recv(BUFFER)
            except TimeoutError:
                continue
            now = time.monotonic()
            if not got:
                raise ConnectionResetError(
                    "the server closed the connection; check that it runs, the driver connects again by itself"
                )
            self._stream.arrived(now, decoder.decode(got))


def _rate(command: socket.socket) -> float | None:
    """Return the rate that the server reports [Hz]; None for an older server, which does not know the request.

    Raises:
        ValueError: the server reports a rate outside `RATES`.
    """
    interval, count = (_request(command, word) for word in (protocol.FRAME_INTERVAL, protocol.FRAME_COUNT))
    try:
        rate = float(count) / float(interval)
    except (ValueError, ZeroDivisionError):
        return None
    if not RATES[0] <= rate <= RATES[1]:
        raise ValueError(f"the server reports a rate of {rate:g} Hz; valid: {RATES[0]:g} to {RATES[1]:g} Hz")
    return rate


def _request(command: socket.socket, word: str) -> str:
    command.sendall(word.encode() + protocol.END)
    return _response(command)


def _response(command: socket.socket) -> str:
    received, deadline = b"", time.monotonic() + TIMEOUT
    while not received.endswith(protocol.END):
        if len(received) > MAX_RESPONSE or time.monotonic() > deadline:
            raise ValueError(f"a response did not end within {MAX_RESPONSE} bytes and {TIMEOUT:g} s")
        data = command.recv(4096)
        if not data:
            raise ConnectionResetError(
                "the server closed the connection; check that it runs, the driver connects again by itself"
            )
        received += data
    return received.decode(errors="replace").strip()
