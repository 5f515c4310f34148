"""Requests to the emulated Motive, and the command that starts it."""

import struct
import sys
from pathlib import Path

import pytest

from hric_core.command import main
from mocap_natnet.codec import Codec, packets
from mocap_natnet.codec.packets import Connect, NatNetMessage, packet, split
from mocap_natnet.codec.types import EDIT_MODE, RECORDING, VERSION_CHANGED
from mocap_natnet.server import Motive, MotiveSettings, SceneBody, ServedScene, SinusoidSource
from mocap_natnet.server.motive import MAX_CLIENTS, Address

sys.path.insert(0, str(Path(__file__).parent))
from natnet_link import one_body

CLIENT: Address = ("10.0.0.2", 50000)


def ask(motive: Motive, words: str, client: Address = CLIENT) -> tuple[int, bytes]:
    ((datagram, to),) = motive.respond(packet(NatNetMessage.REQUEST, words.encode() + b"\0"), client, 1.0)
    assert to == client
    message, end = split(datagram)
    return message, datagram[4:end]


def connect(motive: Motive, payload: bytes = b"", client: Address = CLIENT) -> packets.ServerInfo:
    ((datagram, _),) = motive.respond(packet(NatNetMessage.CONNECT, payload), client, 0.0)
    return packets.decode_server_info(datagram[4:])


@pytest.mark.parametrize(
    "payload", [b"", b"Ping\0", bytes(264), bytes(269), bytes(273), packets.encode_connect(Connect("x"))]
)
def test_every_form_of_connect_gets_a_response(payload: bytes) -> None:
    info = connect(one_body(), payload)
    assert (info.name, info.version, info.multicast, info.data_port, info.group) == (
        "Motive",
        (4, 1),
        True,
        1511,
        "239.255.42.99",
    )


def test_a_server_below_3_0_sends_264_bytes_and_responds_to_no_echo_nor_discovery() -> None:
    motive = one_body(version=(2, 9))
    ((datagram, _),) = motive.respond(packet(NatNetMessage.CONNECT), CLIENT, 0.0)
    assert len(datagram) == 268
    assert motive.respond(packet(NatNetMessage.ECHO_REQUEST, bytes(8)), CLIENT, 0.0) == []
    assert motive.respond(packet(NatNetMessage.DISCOVERY), CLIENT, 0.0) == []


def test_responses_are_those_of_motive() -> None:
    motive = one_body(rate=120.0)
    assert ask(motive, "FrameRate") == (NatNetMessage.RESPONSE, struct.pack("<f", 120.0))
    assert ask(motive, "UnitsToMillimeters") == (NatNetMessage.RESPONSE, struct.pack("<f", 1000.0))
    assert ask(motive, "Bitstream") == (NatNetMessage.RESPONSE, b"Bitstream,4.1\0")
    assert ask(motive, "services2,abc")[0] == NatNetMessage.UNRECOGNIZED_REQUEST
    assert ask(motive, "")[0] == NatNetMessage.UNRECOGNIZED_REQUEST


def test_recording_and_live_mode_are_controlled() -> None:
    motive = one_body()
    assert ask(motive, "SetRecordTakeName,run_7") == (NatNetMessage.RESPONSE, bytes(4))
    assert ask(motive, "StartRecording") == (NatNetMessage.RESPONSE, bytes(4))
    assert motive.take == "run_7" and motive.frame(1).suffix.flags == RECORDING
    ask(motive, "EditMode")
    assert not motive.recording and motive.frame(2).suffix.flags == EDIT_MODE
    assert motive.stream(motive.frame(3), 0.0) == []
    assert ask(motive, "StartRecording") == (NatNetMessage.RESPONSE, struct.pack("<i", 1))
    ask(motive, "LiveMode")
    assert len(motive.stream(motive.frame(4), 0.0)) == 1


def test_unicast_frames_go_where_they_are_requested_until_the_client_falls_silent() -> None:
    for unicast_to, wanted in (
        ("endpoint", [CLIENT]),
        ("data_port", [("10.0.0.2", 1511)]),
        ("both", [CLIENT, ("10.0.0.2", 1511)]),
    ):
        motive = one_body(transport="unicast", unicast_to=unicast_to, client_timeout=5.0)
        assert motive.stream(motive.frame(0), 0.0) == []
        connect(motive)
        assert [to for _, to in motive.stream(motive.frame(1), 1.0)] == wanted
        motive.respond(packet(NatNetMessage.KEEPALIVE) + b"\0", CLIENT, 4.0)
        assert motive.stream(motive.frame(2), 8.9)
        assert motive.stream(motive.frame(3), 9.1) == [] and motive.clients == ()


def test_each_unicast_client_has_its_bitstream_and_leaves_when_it_says_so() -> None:
    motive, other = one_body(transport="unicast", version=(4, 2)), ("10.0.0.3", 50001)
    assert connect(motive, packets.encode_connect(Connect("old", (3, 0)))).version == (3, 0)
    assert connect(motive, client=other).version == (4, 2)
    sent = {to: datagram for datagram, to in motive.stream(motive.frame(1), 1.0)}
    assert Codec((3, 0)).decode_frame(sent[CLIENT]).bodies == Codec((4, 2)).decode_frame(sent[other]).bodies
    assert ask(motive, "Bitstream,4.0") == (NatNetMessage.RESPONSE, bytes(4))
    assert motive.frame(2).suffix.flags & VERSION_CHANGED
    assert ask(motive, "Bitstream,4.5") == (NatNetMessage.RESPONSE, struct.pack("<i", 1))
    motive.respond(packet(NatNetMessage.DISCONNECT), CLIENT, 2.0)
    assert motive.clients == (other,)


def test_what_is_no_request_is_left_unanswered() -> None:
    motive = one_body()
    for datagram in (
        b"",
        b"\1",
        b"\xff" * 20,
        packet(NatNetMessage.FRAMEOFDATA, bytes(50)),
        packet(NatNetMessage.ECHO_REQUEST, b"1234"),
    ):
        assert motive.respond(datagram, CLIENT, 0.0) == []


def test_the_same_seed_gives_the_same_bytes() -> None:
    def stream() -> list[bytes]:
        motive = Motive(
            MotiveSettings(jitter=0.002, loss=0.1, seed=5), ServedScene((SceneBody("marker", SinusoidSource()),))
        )
        return [motive.datagram(motive.frame(n)) for n in range(50)] + [
            repr(motive.delay(n)).encode() for n in range(50)
        ]

    assert stream() == stream()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--bitstream", "7.0"], "2.5 to 4.5"),
        (["--bitstream", "new"], "major.minor"),
        (["--occlude", "soon"], "BEGIN:DURATION"),
        (["--scene", "/nowhere.yaml"], "/nowhere.yaml"),
        (["--duration", "-1"], "--duration"),
        (["--noise", "nan"], "noise"),
    ],
)
def test_a_wrong_argument_ends_the_command_with_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["emulated_motive", "--clock", "wall", *arguments]) == 2
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1


def test_an_address_of_another_machine_is_a_failure_of_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["emulated_motive", "--clock", "wall", "--ip", "203.0.113.7"]) == 1
    assert "cannot listen on 203.0.113.7" in capsys.readouterr().err


def test_a_crowd_of_clients_gets_a_bounded_number_of_frames() -> None:
    motive = one_body(transport="unicast")
    for port in range(1, 1000):
        motive.respond(packet(NatNetMessage.CONNECT), ("10.0.0.2", port), 0.0)
    assert len(motive.stream(motive.frame(0), 0.0)) == MAX_CLIENTS
