"""The client's side of the conversation, without sockets: datagrams and times in, frames out, and what is to be sent."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from mocap_natnet.client.requests import Requests
from mocap_natnet.client.settings import Route, Settings
from mocap_natnet.client.statistics import Statistics
from mocap_natnet.clock import ExposureClock
from mocap_natnet.codec import Codec, CodecError, packets
from mocap_natnet.codec.descriptions import Model
from mocap_natnet.codec.packets import DATA_PORT, HEADER, MULTICAST_GROUP, Connect, Message, ServerInfo, packet
from mocap_natnet.codec.types import MODEL_CHANGED, VERSION_CHANGED, Frame

NS = 1_000_000_000
CONNECT_PERIOD = NS // 2
"""Between attempts to connect [ns] (our choice)."""
MODEL_PERIOD = NS // 2
"""Between requests for the description until it comes [ns] (our choice)."""
ECHO_PERIOD = NS // 10
"""Between echoes [ns]; ten a second keep the fit within 10 us."""
FIRST_ECHOES, FIRST_ECHO_PERIOD = 8, NS // 50
"""The first ones follow each other faster [ns] (our choice)."""
KEEP_ALIVE_PERIOD = NS
"""Between signs of life [ns]; the vendor's sample sends one at least every 2 s."""
SILENT = NS // 2
"""A channel that says nothing for this long is silent [ns] (our choice)."""
REORDERED, GAP, AHEAD = 100, 5, 5000
"""A frame that is late by no more frames than the first came by another way; one that is ahead by no more than the second follows a gap.
Any other number is believed once a second frame goes on from it, since a single one is a fault of the network: up to the third ahead it is
a long gap, else another stream (our choice)."""
FAILED_CONNECT_PERIOD = NS // 4
"""Least time between attempts after a datagram that could not be read [ns] (our choice)."""
NAME = "mocap_natnet"


class Received(NamedTuple):
    """A frame.

    Attributes:
        frame: as read.
        received: when it arrived, monotonic clock [ns].
        exposed: middle of the exposure, the same clock [ns].
        means: what told that time, see `clock.ExposureClock`.
    """

    frame: Frame
    received: int
    exposed: int
    means: str


class Session:
    """A conversation that begins, breaks and begins anew by itself. Not thread-safe: one thread calls all of it but `requests.ask`.

    Args:
        settings: how to find the server.
        on_frame: gets each frame that is newer than those before.
        on_model: gets each description.
        on_restart: called when the stream begins anew or is another one.

    Attributes:
        info: what the server says of itself, or None before it answered.
        complaint: why the server's answer cannot be used, or "".
        model: the newest description, or None.
        last_answer, last_frame: when the command and the data channel spoke last [ns], or None.
    """

    def __init__(
        self,
        settings: Settings,
        on_frame: Callable[[Received], None] = lambda frame: None,
        on_model: Callable[[Model], None] = lambda model: None,
        on_restart: Callable[[], None] = lambda: None,
    ) -> None:
        self.settings, self.statistics, self.requests = settings, Statistics(), Requests()
        self.clock = ExposureClock(settings.nominal_latency)
        self.info: ServerInfo | None = None
        self.complaint = ""
        self.model: Model | None = None
        self.last_answer: int | None = None
        self.last_frame: int | None = None
        self._on_frame, self._on_model, self._on_restart = on_frame, on_model, on_restart
        self._codec: Codec | None = None
        self._last_number: int | None = None
        self._echoes: dict[int, None] = {}
        self._echoes_sent = 0
        self._suspect: int | None = None
        self._connect_asked = True
        self._due = dict.fromkeys(("model", "echo", "keep alive"), 0)
        self._last_connect = -NS

    @property
    def route(self) -> Route | None:
        """Where frames come from; None before the server answered."""
        if self.info is None or self._codec is None:
            return None
        settings, info = self.settings, self.info
        says = info.multicast if settings.transport == "auto" else settings.transport == "multicast"
        group = settings.group or info.group or MULTICAST_GROUP
        port = settings.data_port or info.data_port or DATA_PORT
        return Route(says is not False, says is not True, group, port)

    def receive(self, datagram: bytes, now: int) -> None:
        """Take a datagram; one that cannot be used is counted by its reason.

        Args:
            datagram: from any socket.
            now: when it arrived, monotonic clock [ns].
        """
        try:
            message, end = packets.split(datagram)
            self._take(message, datagram, end, now)
        except CodecError as error:
            self.statistics.refused[error.reason] += 1
            self._connect_asked = True  # perhaps it speaks another bitstream now

    def poll(self, now: int) -> list[bytes]:
        """What is to be sent to the server now. Call it every 20 ms or more often."""
        out: list[bytes] = []
        if self._wants_connect(now):
            self._connect_asked, self._last_connect = False, now
            self.statistics.connects += 1
            out.append(packet(Message.CONNECT, packets.encode_connect(Connect(NAME, self.settings.bitstream))))
        if self._codec is None or self.info is None:
            return out
        if self.clock.echo is not None and now >= self._due["echo"]:
            out.append(self._echo(now))
        if now >= self._due["keep alive"]:
            self._due["keep alive"] = now + KEEP_ALIVE_PERIOD
            out.append(packet(Message.KEEPALIVE))
        if self.model is None and now >= self._due["model"]:
            self._due["model"] = now + MODEL_PERIOD
            out.append(packet(Message.REQUEST_MODELDEF))
        return out + self.requests.poll(now)

    def silent(self, now: int) -> tuple[bool, bool]:
        """Whether the command channel and whether the data channel is silent. A server below 3.0 answers no echo and may stay silent for longer."""
        patience = SILENT if self.clock.echo is not None else 2 * KEEP_ALIVE_PERIOD + SILENT
        return (
            self.last_answer is None or now - self.last_answer > patience,
            self.last_frame is None or now - self.last_frame > SILENT,
        )

    def _wants_connect(self, now: int) -> bool:
        since = now - self._last_connect
        if self._connect_asked and since >= FAILED_CONNECT_PERIOD:
            return True
        if since < CONNECT_PERIOD:
            return False
        old_server = self.clock.echo is None and since >= KEEP_ALIVE_PERIOD  # it answers nothing but this
        return self._codec is None or old_server or any(self.silent(now))

    def _take(self, message: int, datagram: bytes, end: int, now: int) -> None:
        payload = datagram[HEADER.size : end]
        if message == Message.FRAMEOFDATA:
            self._frame(datagram, end, now)
            return
        if message == Message.SERVERINFO:
            self._server_info(packets.decode_server_info(payload))
        elif message == Message.MODELDEF:
            self._describe(datagram, end)
        elif message == Message.ECHO_RESPONSE:
            self._echoed(*packets.decode_echo_response(payload), now)
        elif message in (Message.RESPONSE, Message.UNRECOGNIZED_REQUEST):
            self.requests.answered(payload if message == Message.RESPONSE else None)
        elif message == Message.DISCONNECT_BY_TIMEOUT:
            self._connect_asked = True
        elif message != Message.MESSAGESTRING:
            raise CodecError("unknown message", f"{Message(message).name} is no message of a server")
        self.last_answer = now

    def _server_info(self, info: ServerInfo) -> None:
        if info == self.info and self._codec is not None:
            return
        try:
            codec = Codec(info.version)
        except CodecError as error:
            self.complaint = f"{info.name or 'the server'} {'.'.join(map(str, info.application))}: {error}"
            raise
        changed = self.info is not None
        self.info, self._codec, self.complaint = info, codec, ""
        self._begin(changed)

    def _begin(self, anew: bool) -> None:
        """Another stream, or the first one."""
        assert self.info is not None
        self.clock.restart(self.info.clock_frequency)
        self.model, self._last_number, self._suspect = None, None, None
        self._echoes.clear()
        self._echoes_sent = 0
        self._due = dict.fromkeys(self._due, 0)
        if anew:
            self.statistics.restarts += 1
        self._on_restart()

    def _frame(self, datagram: bytes, end: int, now: int) -> None:
        if self._codec is None:
            self.statistics.refused["before server information"] += 1
            return
        frame = self._codec.decode_frame(datagram, end)
        if not self._follows(frame.number):
            return
        self._last_number, self.last_frame = frame.number, now
        exposed, means = self.clock.exposed(frame, now)
        self.statistics.frame(now, exposed, means, frame.skipped)
        if frame.suffix.flags & VERSION_CHANGED:
            self._connect_asked = True
        if frame.suffix.flags & MODEL_CHANGED:
            self.model = None
        self._on_frame(Received(frame, now, exposed, means))

    def _follows(self, number: int) -> bool:
        """Whether a frame is newer than the last; counts why it is not, and what lies between."""
        if self._last_number is None:
            return True
        step = number - self._last_number
        if -REORDERED <= step <= 0:
            self.statistics.refused["late" if step else "duplicate"] += 1
            return False
        if not 0 < step <= GAP and (self._suspect is None or not 0 < number - self._suspect <= GAP):
            self._suspect = number
            self.statistics.refused["number"] += 1
            return False
        if 0 < step <= AHEAD:
            self.statistics.lost += step - 1
        else:
            self._begin(anew=True)
            self._connect_asked = True
        self._suspect = None
        return True

    def _describe(self, datagram: bytes, end: int) -> None:
        if self._codec is None:
            self.statistics.refused["before server information"] += 1
            return
        self.model = self._codec.decode_model(datagram, end)
        self._on_model(self.model)

    def _echo(self, now: int) -> bytes:
        self._echoes_sent += 1
        self._due["echo"] = now + (FIRST_ECHO_PERIOD if self._echoes_sent < FIRST_ECHOES else ECHO_PERIOD)
        self._echoes[now] = None
        while len(self._echoes) > 50:
            self._echoes.pop(next(iter(self._echoes)))
        return packet(Message.ECHO_REQUEST, packets.encode_echo_request(now))

    def _echoed(self, stamp: int, ticks: int, now: int) -> None:
        """The answer to an echo of ours; another one is counted."""
        if stamp not in self._echoes:
            self.statistics.refused["echo"] += 1
            return
        del self._echoes[stamp]
        if self.clock.echo is not None:
            self.clock.echo.add(stamp, now, ticks)
