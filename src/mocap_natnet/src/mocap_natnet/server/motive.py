"""Emulated Motive without sockets: frames of a scene, responses to requests, and the clients that receive frames."""

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mocap_natnet.codec import Codec, CodecError, Version, packets, parse, text
from mocap_natnet.codec.packets import HEADER, NatNetMessage, ServerInfo, packet
from mocap_natnet.codec.types import EDIT_MODE, MODEL_CHANGED, RECORDING, VERSION_CHANGED, Frame, Suffix
from mocap_natnet.server.scene import ServedScene
from mocap_natnet.server.settings import MotiveSettings

Address = tuple[str, int]
Outgoing = list[tuple[bytes, Address]]

NAME = "Motive"
APPLICATION = (3, 1, 0, 0)
RUBBISH = bytes(range(0x80, 0x100)) * 2
"""Bytes after the name in server information, like the old memory contents in real packets."""
_OK = struct.pack("<i", 0)
_FAILED = struct.pack("<i", 1)
_DONE_BY_NAME = (
    "LiveMode",
    "EditMode",
    "StartRecording",
    "StopRecording",
    "TimelinePlay",
    "TimelineStop",
    "SetRecordTakeName",
)
_ACCEPTED = frozenset(
    (
        *(
            "SetPlaybackTakeName",
            "SetPlaybackStartFrame",
            "SetPlaybackStopFrame",
            "SetPlaybackCurrentFrame",
            "SetPlaybackLooping",
            "SetCurrentSession",
        ),
        *("EnableAsset", "DisableAsset", "SubscribeToData", "SubscribeByID", "SubscribedDataOnly"),
    )
)
"""Commands that are acknowledged, but have no effect here."""

MAX_CLIENTS = 32
"""Largest number of unicast clients; further ones get no response (project default, unconfirmed)."""


@dataclass
class _Client:
    """Client that receives frames by unicast: its bitstream, and when its last datagram came [s]."""

    version: Version
    received: float


class Motive:
    """Emulated Motive without sockets: makes frames of a scene, and responses to requests.

    Args:
        settings: settings of the stream.
        scene: scene of the cameras.

    Attributes:
        recording: True while a take is being recorded.
        take: name of the take.
        live: False in edit mode, in which nothing is streamed.
        hardware: function from stream time [s] to time by the server's clock [s], which continues while a stream in
            robot time pauses.
    """

    def __init__(self, settings: MotiveSettings, scene: ServedScene) -> None:
        self.settings, self.scene = settings, scene
        self.recording, self.take, self.live = False, "", True
        self.hardware: Callable[[float], float] = _same
        self._version = settings.version
        self._codecs: dict[Version, Codec] = {}
        self._clients: dict[Address, _Client] = {}
        self._pending_flags = 0

    @property
    def clients(self) -> tuple[Address, ...]:
        """Addresses of the clients that receive frames by unicast."""
        return tuple(self._clients)

    @property
    def version(self) -> Version:
        """Current bitstream (version of the protocol)."""
        return self._version

    def change_version(self, version: Version) -> None:
        """Change the bitstream from the next frame on, as after a change of Motive's settings. Raises CodecError."""
        self._codec(version)
        self._version, self._pending_flags = version, self._pending_flags | VERSION_CHANGED
        for client in self._clients.values():
            client.version = version

    def change_scene(self, scene: ServedScene) -> None:
        """Change the scene from the next frame on; a flag of that frame says that the description changed."""
        self.scene, self._pending_flags = scene, self._pending_flags | MODEL_CHANGED

    def delay(self, number: int) -> float | None:
        """Return the latency of a frame [s]; None: the frame is lost. It depends only on the seed and the number."""
        settings = self.settings
        if not settings.jitter and not settings.loss:
            return settings.latency
        share, lost = np.random.default_rng((settings.seed, number, 1)).random(2).tolist()
        return None if lost < settings.loss else settings.latency + share * settings.jitter

    def frame(self, number: int) -> Frame:
        """Return a frame, exposed at stream time number / rate (middle of the exposure) and sent one latency later."""
        settings = self.settings
        time = number * settings.period
        sent = time + (self.delay(number) or settings.latency)
        flags = (RECORDING if self.recording else 0) | (0 if self.live else EDIT_MODE) | self._pending_flags
        self._pending_flags = 0
        exposed, transmitted = self.hardware(time), self.hardware(sent)
        suffix = Suffix(
            time_stamp=exposed,
            mid_exposure=settings.ticks(exposed) if settings.exposure_known else 0,
            received=settings.ticks(
                max(exposed, transmitted - min(settings.latency, 0.0009))
            ),  # a capture of a real server shows 0.9 ms for its software
            transmitted=settings.ticks(transmitted),
            flags=flags,
        )
        return self.scene.frame(number, time, settings.period, suffix)

    def datagram(self, frame: Frame, version: Version | None = None) -> bytes:
        """Return the datagram of a frame in a bitstream (default: the server's)."""
        return self._codec(version or self._version).encode_frame(frame)

    def stream(self, frame: Frame, time: float) -> Outgoing:
        """Return the datagrams of a frame and their destinations.

        Args:
            frame: frame from `frame()`.
            time: time by the server's clock [s], by which silent clients are removed.
        """
        settings = self.settings
        if not self.live:
            return []
        if settings.transport == "multicast":
            return [(self.datagram(frame), (settings.group, settings.data_port))]
        if settings.client_timeout:
            self._clients = {
                key: client
                for key, client in self._clients.items()
                if time - client.received <= settings.client_timeout
            }
        made = {client.version: b"" for client in self._clients.values()}
        for version in made:
            made[version] = self.datagram(frame, version)
        datagrams: Outgoing = []
        for address, client in self._clients.items():
            if settings.unicast_to in ("endpoint", "both"):
                datagrams.append((made[client.version], address))
            if settings.unicast_to in ("data_port", "both") and address[1] != settings.data_port:
                datagrams.append((made[client.version], (address[0], settings.data_port)))
        return datagrams

    def respond(self, datagram: bytes, sender: Address, time: float, latest: int | None = None) -> Outgoing:
        """Return the responses to a datagram; empty if it is not a request.

        Args:
            datagram: received datagram.
            sender: sender of the datagram.
            time: arrival by the server's clock [s].
            latest: number of the latest frame; None: computed from `time`, if the stream uses the server's clock.
        """
        try:
            message, end = packets.split(datagram)
        except CodecError:
            return []
        payload = datagram[HEADER.size : end]
        if client := self._clients.get(sender):
            client.received = time
        if message == NatNetMessage.CONNECT:
            return self._connect(datagram[HEADER.size :], sender, time)
        if message == NatNetMessage.DISCOVERY:
            return [(self._server_info(self._version), sender)] if self._version >= (3, 0) else []
        if message == NatNetMessage.REQUEST_MODELDEF:
            return [(self._codec(self._version_of(sender)).encode_model(self.scene.model()), sender)]
        if message == NatNetMessage.ECHO_REQUEST:
            return self._echo(payload, sender, time)
        if message == NatNetMessage.REQUEST:
            return [(self._request(payload.split(b"\0", 1)[0].decode(errors="replace"), sender), sender)]
        if message == NatNetMessage.REQUEST_FRAMEOFDATA:
            number = max(0, int(time * self.settings.rate)) if latest is None else latest
            return [(self.datagram(self.frame(number), self._version_of(sender)), sender)]
        if message == NatNetMessage.DISCONNECT:
            self._clients.pop(sender, None)
        return []

    def _codec(self, version: Version) -> Codec:
        if version not in self._codecs:
            self._codecs[version] = Codec(version)
        return self._codecs[version]

    def _version_of(self, sender: Address) -> Version:
        client = self._clients.get(sender)
        return client.version if client else self._version

    def _may_speak(self, version: Version) -> bool:
        """Return True if a unicast client may request this bitstream."""
        return self.settings.transport == "unicast" and self._version >= (3, 0) and (3, 0) <= version <= self._version

    def _connect(self, payload: bytes, sender: Address, time: float) -> Outgoing:
        if sender not in self._clients and len(self._clients) >= MAX_CLIENTS:
            return []
        requested = packets.decode_connect(payload).version
        version = requested if requested and self._may_speak(requested) else self._version
        if self.settings.transport == "unicast":
            self._clients[sender] = _Client(version, time)
        return [(self._server_info(version), sender)]

    def _server_info(self, version: Version) -> bytes:
        settings = self.settings
        info = ServerInfo(
            NAME,
            APPLICATION,
            version,
            settings.frequency,
            settings.data_port,
            settings.transport == "multicast",
            settings.group,
        )
        return packet(NatNetMessage.SERVERINFO, packets.encode_server_info(info, RUBBISH))

    def _echo(self, payload: bytes, sender: Address, time: float) -> Outgoing:
        if self._version < (3, 0) or len(payload) < 8:
            return []
        stamp = packets.decode_echo_request(payload)
        return [
            (
                packet(NatNetMessage.ECHO_RESPONSE, packets.encode_echo_response(stamp, self.settings.ticks(time))),
                sender,
            )
        ]

    def _request(self, words: str, sender: Address) -> bytes:
        name, _, argument = words.partition(",")
        if name == "Bitstream":
            return self._bitstream(argument, sender)
        values = {
            "FrameRate": struct.pack("<f", self.settings.rate),
            "UnitsToMillimeters": struct.pack("<f", 1000.0),
            "CurrentMode": struct.pack("<i", 0 if self.live else 2),
            "AnalogSamplesPerMocapFrame": struct.pack(
                "<i", max((plate.samples for plate in self.scene.plates), default=0)
            ),
            "CurrentTakeLength": _OK,
            "CurrentSessionPath": b"emulated\0",
        }
        if name in values:
            return packet(NatNetMessage.RESPONSE, values[name])
        if name in _ACCEPTED:
            return packet(NatNetMessage.RESPONSE, _OK)
        if name in _DONE_BY_NAME:
            return packet(NatNetMessage.RESPONSE, _OK if self._control(name, argument) else _FAILED)
        return packet(NatNetMessage.UNRECOGNIZED_REQUEST)

    def _control(self, name: str, argument: str) -> bool:
        """Execute a command, such as StartRecording; return False if it cannot be executed now."""
        if name == "StartRecording":
            if not self.live:
                return False
            self.recording = True
        elif name == "StopRecording":
            self.recording = False
        elif name in ("LiveMode", "EditMode"):
            self.live = name == "LiveMode"
            self.recording = self.recording and self.live
        elif name == "SetRecordTakeName":
            self.take = argument
        return True

    def _bitstream(self, argument: str, sender: Address) -> bytes:
        if not argument:
            return packet(NatNetMessage.RESPONSE, f"Bitstream,{text(self._version_of(sender))}".encode() + b"\0")
        try:
            version = parse(argument)
        except CodecError:
            return packet(NatNetMessage.RESPONSE, _FAILED)
        client = self._clients.get(sender)
        if client is None or not self._may_speak(version):
            return packet(NatNetMessage.RESPONSE, _FAILED)
        client.version, self._pending_flags = version, self._pending_flags | VERSION_CHANGED
        return packet(NatNetMessage.RESPONSE, _OK)


def _same(time: float) -> float:
    return time
