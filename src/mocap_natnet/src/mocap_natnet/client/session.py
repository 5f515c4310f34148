"""Client's side of a NatNet session, without sockets: takes datagrams, returns frames and datagrams to send."""

from collections.abc import Callable

from mocap_natnet.client.frame_clock import ExposureClock
from mocap_natnet.client.received import NS, Received, Statistics
from mocap_natnet.client.requests import Requests
from mocap_natnet.client.settings import ClientSettings, Route
from mocap_natnet.codec import Codec, CodecError, packets
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.codec.packets import DATA_PORT, HEADER, MULTICAST_GROUP, Connect, NatNetMessage, ServerInfo, packet
from mocap_natnet.codec.types import MODEL_CHANGED, VERSION_CHANGED, Frame

CONNECT_PERIOD = NS // 2
"""Time between attempts to connect [ns] (project default, unconfirmed)."""
MODEL_PERIOD = NS // 2
"""Time between requests for the server's description, until it arrives [ns] (project default, unconfirmed)."""
ECHO_PERIOD = NS // 10
"""Time between clock echoes [ns]; ten per second keep the fit of the server's clock within 10 us."""
FIRST_ECHOES, FIRST_ECHO_PERIOD = 8, NS // 50
"""Number and period [ns] of the first clock echoes, which are faster (project default, unconfirmed)."""
GOOD_ROUND_TRIP = 1e-3
"""Round trip up to which an echo makes the server's clock well known [s]; time errors are at most half of it.

Without such an echo, frames are not used for CLOCK_PATIENCE (project default, unconfirmed).
"""
CLOCK_PATIENCE = NS
"""Time after which frames are used even if the server's clock is not well known [ns] (project default, unconfirmed)."""
KEEP_ALIVE_PERIOD = NS
"""Time between keep-alive messages [ns]; the vendor's sample sends one at least every 2 s."""
SILENT = NS // 2
"""Time without messages after which a channel is silent [ns] (project default, unconfirmed)."""
REORDERED, GAP, AHEAD = 100, 5, 5000
"""Limits of steps in frame numbers: up to REORDERED back is a late frame, up to GAP ahead follows lost frames.

Any other number is accepted once a second frame continues it, since a single one is a fault of the network: up to AHEAD
it is a long gap, else another stream (project default, unconfirmed).
"""
FAILED_CONNECT_PERIOD = NS // 4
"""Minimum time between attempts to connect after an unreadable datagram [ns] (project default, unconfirmed)."""
NAME = "mocap_natnet"


class Session:
    """Session with a NatNet server that connects and reconnects automatically; only `requests.send` is thread-safe.

    Args:
        settings: settings of the connection.
        on_frame: callback for each frame that is newer than those before.
        on_model: callback for each description of the server's bodies.
        on_restart: callback when the stream restarts or is another one.

    Attributes:
        info: server information, or None before it responded.
        complaint: reason why the server cannot be used, or "".
        model: newest description of the server's bodies, or None.
        last_response, last_frame: time of the last message on command and data channel [ns], or None.
    """

    def __init__(
        self,
        settings: ClientSettings,
        on_frame: Callable[[Received], None] = lambda frame: None,
        on_model: Callable[[ServerModel], None] = lambda model: None,
        on_restart: Callable[[], None] = lambda: None,
    ) -> None:
        self.settings, self.statistics, self.requests = settings, Statistics(), Requests()
        self.clock = ExposureClock(settings.nominal_latency)
        self.info: ServerInfo | None = None
        self.complaint = ""
        self.model: ServerModel | None = None
        self.last_response: int | None = None
        self.last_frame: int | None = None
        self._on_frame, self._on_model, self._on_restart = on_frame, on_model, on_restart
        self._codec: Codec | None = None
        self._sequence: int | None = None
        self._echoes: dict[int, None] = {}
        self._echoes_sent = 0
        self._suspect: int | None = None
        self._connect_due, self._connecting = True, False
        self._described: frozenset[int] = frozenset()
        self._undescribed, self._clock_deadline = False, 0
        self._due = dict.fromkeys(("model", "echo", "keep alive"), 0)
        self._last_connect = -NS

    @property
    def route(self) -> Route | None:
        """Addresses on which frames are expected; None before the server responded."""
        if self.info is None or self._codec is None:
            return None
        settings, info = self.settings, self.info
        says = info.multicast if settings.transport == "auto" else settings.transport == "multicast"
        group = settings.group or info.group or MULTICAST_GROUP
        port = settings.data_port or info.data_port or DATA_PORT
        return Route(says is not False, says is not True, group, port)

    def receive(self, datagram: bytes, now: int) -> None:
        """Process a datagram, and count it; an unusable one by the reason.

        Args:
            datagram: datagram received on any socket.
            now: arrival by the monotonic clock [ns].
        """
        try:
            message, end = packets.split(datagram)
            refusal = self._take(message, datagram, end, now)
        except CodecError as error:
            refusal = error.reason
            self._connect_due = True  # the server may have changed its bitstream
        if refusal:
            self.statistics.refused[refusal] += 1
        else:
            self.statistics.taken[NatNetMessage(message).name] += 1

    def poll(self, now: int) -> list[bytes]:
        """Return the datagrams to be sent to the server; now: monotonic clock [ns]. Call it at least every 20 ms."""
        out: list[bytes] = []
        if self._wants_connect(now):
            self._connect_due, self._connecting, self._last_connect = False, True, now
            self.statistics.connects += 1
            out.append(packet(NatNetMessage.CONNECT, packets.encode_connect(Connect(NAME, self.settings.bitstream))))
        if self._codec is None or self.info is None:
            return out
        if self.clock.echo is not None and now >= self._due["echo"]:
            out.append(self._echo(now))
        if now >= self._due["keep alive"]:
            self._due["keep alive"] = now + KEEP_ALIVE_PERIOD
            out.append(packet(NatNetMessage.KEEPALIVE))
        if self._wants_model and now >= self._due["model"]:
            self._due["model"] = now + MODEL_PERIOD
            out.append(packet(NatNetMessage.REQUEST_MODELDEF))
        return out + self.requests.poll(now)

    def silent(self, now: int) -> tuple[bool, bool]:
        """Return (True if the command channel is silent, True if the data channel is silent).

        A server below bitstream 3.0 does not respond to echoes, so its command channel may be silent for longer.
        """
        patience = SILENT if self.clock.echo is not None else 2 * KEEP_ALIVE_PERIOD + SILENT
        return (
            self.last_response is None or now - self.last_response > patience,
            self.last_frame is None or now - self.last_frame > SILENT,
        )

    def _wants_connect(self, now: int) -> bool:
        since = now - self._last_connect
        if self._connect_due and since >= FAILED_CONNECT_PERIOD:
            return True
        if since < CONNECT_PERIOD:
            return False
        # A server below 3.0 responds only to connect requests, which also show that it is alive.
        old_server = self.clock.echo is None and since >= KEEP_ALIVE_PERIOD
        return self._codec is None or old_server or any(self.silent(now))

    @property
    def _unsure(self) -> bool:
        """True if no echo was fast enough to know the server's clock well."""
        echo = self.clock.echo
        return echo is not None and (echo.round_trip is None or echo.round_trip > GOOD_ROUND_TRIP)

    @property
    def _wants_model(self) -> bool:
        """True if there is no description, or a frame contained a body that the description lacks."""
        return self.model is None or self._undescribed

    def _take(self, message: int, datagram: bytes, end: int, now: int) -> str:
        """Process a datagram; return "" or the reason why it cannot be used."""
        payload, refusal = datagram[HEADER.size : end], ""
        if message == NatNetMessage.FRAMEOFDATA:
            return self._frame(datagram, end, now)
        if message == NatNetMessage.SERVERINFO:
            refusal = self._server_info(packets.decode_server_info(payload))
        elif message == NatNetMessage.MODELDEF:
            refusal = self._describe(datagram, end)
        elif message == NatNetMessage.ECHO_RESPONSE:
            refusal = self._echoed(*packets.decode_echo_response(payload), now)
        elif message in (NatNetMessage.RESPONSE, NatNetMessage.UNRECOGNIZED_REQUEST):
            self.requests.respond(payload if message == NatNetMessage.RESPONSE else None)
        elif message == NatNetMessage.DISCONNECT_BY_TIMEOUT:
            self._connect_due = True
        elif message != NatNetMessage.MESSAGESTRING:
            raise CodecError("unknown message", f"{NatNetMessage(message).name} is not a message of a server")
        self.last_response = now
        return refusal

    def _server_info(self, info: ServerInfo) -> str:
        """Process server information; if it differs and was not requested, refuse it and send a connect request."""
        requested, self._connecting = self._connecting, False
        if info == self.info and self._codec is not None:
            self.complaint = ""
            return ""
        if self.info is not None and not requested:
            self._connect_due = True
            return "unasked"
        try:
            codec = Codec(info.version)
        except CodecError as error:
            self.complaint = f"{info.name or 'the server'} {'.'.join(map(str, info.application))}: {error}"
            raise
        changed = self.info is not None
        self._codec, self.info, self.complaint = (
            codec,
            info,
            "",
        )  # in this order, since other threads read `info` and then `route`
        self._begin(changed)
        return ""

    def _begin(self, again: bool) -> None:
        """Begin a stream; again: True if it replaces another one."""
        assert self.info is not None
        self.clock.restart(self.info.clock_frequency)
        self.model, self._sequence, self._suspect = None, None, None
        self._echoes.clear()
        self._echoes_sent = self._clock_deadline = 0
        self._due = dict.fromkeys(self._due, 0)
        if again:
            self.statistics.restarts += 1
        self._on_restart()

    def _frame(self, datagram: bytes, end: int, now: int) -> str:
        if self._codec is None:
            return "before server information"
        frame = self._codec.decode_frame(datagram, end)
        if refusal := self._out_of_order(frame.number):
            return refusal
        self._sequence, self.last_frame = frame.number, now
        self._heed(frame)
        self._clock_deadline = self._clock_deadline or now + CLOCK_PATIENCE
        if self._unsure and now < self._clock_deadline:
            return "before the clock is known"
        exposed, means = self.clock.exposed(frame, now)
        self.statistics.frame(now, exposed, means, frame.skipped)
        self._on_frame(Received(frame, now, exposed, means))
        return ""

    def _heed(self, frame: Frame) -> None:
        """React to a frame's flags (bitstream or description changed) and to bodies without description."""
        if frame.suffix.flags & VERSION_CHANGED:
            self._connect_due = True
        if frame.suffix.flags & MODEL_CHANGED:
            self.model = None
        elif self.model is not None and not self._described.issuperset([body.id for body in frame.bodies]):
            self._undescribed = True

    def _out_of_order(self, number: int) -> str:
        """Return why a frame of this number does not follow the last one, or "", and count missing frames."""
        if self._sequence is None:
            return ""
        step = number - self._sequence
        if -REORDERED <= step <= 0:
            return "late" if step else "duplicate"
        if not 0 < step <= GAP and (self._suspect is None or not 0 < number - self._suspect <= GAP):
            self._suspect = number
            return "number"
        if 0 < step <= AHEAD:
            self.statistics.lost += step - 1
        else:
            self._begin(again=True)
            self._connect_due = True
        self._suspect = None
        return ""

    def _describe(self, datagram: bytes, end: int) -> str:
        if self._codec is None:
            return "before server information"
        if not self._wants_model:
            return "unasked"
        self.model = self._codec.decode_model(datagram, end)
        self._described, self._undescribed = frozenset(self.model.bodies), False
        self._on_model(self.model)
        return ""

    def _echo(self, now: int) -> bytes:
        self._echoes_sent += 1
        self._due["echo"] = now + (
            FIRST_ECHO_PERIOD if self._echoes_sent < FIRST_ECHOES or self._unsure else ECHO_PERIOD
        )
        self._echoes[now] = None
        while len(self._echoes) > 50:
            self._echoes.pop(next(iter(self._echoes)))
        return packet(NatNetMessage.ECHO_REQUEST, packets.encode_echo_request(now))

    def _echoed(self, stamp: int, ticks: int, now: int) -> str:
        """Process the response to an echo; responses to echoes that this client did not send are refused."""
        if stamp not in self._echoes:
            return "echo"
        del self._echoes[stamp]
        echo = self.clock.echo
        if echo is not None:
            before = echo.restarts
            echo.add(stamp, now, ticks)
            if echo.restarts > before:  # another server, or one whose frequency was misread
                self._connect_due = True
        return ""
