"""The client and the emulated Motive on real sockets: both transports, discovery, restarts, requests, rubbish."""

import itertools
import math
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from real_master import free_port

from hric_core.errors import CommandError, HricError
from hric_core.geometry import Pose
from mocap_natnet.client import ClientSettings, NatNetClient, Received
from mocap_natnet.client.client import ERROR, OK
from mocap_natnet.codec.descriptions import ServerModel
from mocap_natnet.codec.packets import NatNetMessage, packet
from mocap_natnet.server import Motive, MotiveServer, SceneBody, ServedScene, SinusoidSource
from mocap_natnet.server import MotiveSettings as ServerSettings
from mocap_natnet.tracking.tracking import Tracker
from mocap_natnet.tracking.validity import PoseValidator

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import motive
from natnet_samples import Sample

pytestmark = pytest.mark.alone

PATIENCE = 20.0
"""Time-out of waiting, for a busy machine [s]."""


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def wait(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.01)


def server(ports: tuple[int, int], **settings: object) -> MotiveServer:
    made = ServerSettings(command_port=ports[0], data_port=ports[1], **settings)
    return MotiveServer(Motive(made, ServedScene((SceneBody("marker", SinusoidSource()),))))


def client(ports: tuple[int, int], frames: list[Received], **settings: object) -> NatNetClient:
    return NatNetClient(ClientSettings(**{"command_port": ports[0], "local": "127.0.0.1", **settings}), frames.append)


@pytest.mark.parametrize("transport", ["multicast", "unicast"])
def test_frames_arrive_in_order_and_at_their_places(transport: str, stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    stack.enter_context(
        motive("--transport", transport, "--command-port", str(ports[0]), "--data-port", str(ports[1]), "--up", "z")
    )
    one = stack.enter_context(client(ports, frames))
    wait(lambda: len(frames) > 240 and one.session.model is not None)
    assert one.health().level == OK
    assert one.session.statistics.lost == 0
    for received in frames:
        expected = 0.1 * math.sin(2 * math.pi * 0.25 * received.frame.number / 240)
        assert received.frame.bodies[0].position == pytest.approx((expected, 0.0, 1.0), abs=1e-6)
    ask = one.request("FrameRate")
    assert struct.unpack("<f", ask)[0] == 240.0


def test_the_time_out_that_rospy_sets_for_all_sockets_does_not_keep_the_client_waiting(stack: ExitStack) -> None:
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(60.0)
    stack.callback(socket.setdefaulttimeout, before)
    ports, frames = (free_port(), free_port()), []
    stack.enter_context(server(ports, transport="unicast"))
    one = client(ports, frames)
    one.start()
    wait(lambda: len(frames) > 60)
    begun = time.monotonic()
    one.close()
    assert time.monotonic() - begun < PATIENCE


@pytest.mark.parametrize("unicast_to", ["data_port", "both"])
def test_unicast_to_the_data_port_arrives_too_and_no_frame_twice(unicast_to: str, stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    stack.enter_context(server(ports, transport="unicast", unicast_to=unicast_to))
    stack.enter_context(client(ports, frames))
    wait(lambda: len(frames) > 60)
    numbers = [received.frame.number for received in frames]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_a_server_is_found_by_discovery(stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    stack.enter_context(server(ports))
    one = stack.enter_context(client(ports, frames, server="", discovery="127.0.0.1"))
    wait(lambda: len(frames) > 10)
    assert one.server == "127.0.0.1"


def test_the_client_may_start_first_and_the_server_may_come_back_as_another(stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    one = stack.enter_context(client(ports, frames, data_port=ports[1]))  # a server below 3.0 does not tell it
    wait(lambda: one.health().level == ERROR)
    assert f"127.0.0.1:{ports[0]} does not respond" in one.health().text
    for transport, version in (("multicast", (4, 1)), ("unicast", (3, 0)), ("multicast", (2, 9))):
        before = len(frames)
        with server(ports, transport=transport, version=version):
            wait(lambda before=before: len(frames) > before + 60)
            assert one.session.info.version == version
        wait(lambda: one.health().level == ERROR)


def test_a_request_without_response_or_that_nobody_knows_is_an_error(stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    one = stack.enter_context(client(ports, frames))
    with pytest.raises(CommandError, match="does not respond"):
        one.request("StartRecording", 0.1)
    with server(ports) as there:
        wait(lambda: len(frames) > 5)
        with pytest.raises(CommandError, match="does not know"):
            one.request("Fly")
        one.request("SetRecordTakeName,run")
        one.request("StartRecording")
        assert there.motive.recording and there.motive.take == "run"


def test_times_on_a_real_socket_are_those_of_the_exposure(stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    there = stack.enter_context(server(ports, drift=50.0))
    one = stack.enter_context(client(ports, frames))
    wait(lambda: sum(received.means == "mid-exposure" for received in frames) > 480)
    errors = [
        received.exposed / 1e9 - there._time._began - received.frame.number / 240
        for received in frames
        if received.means == "mid-exposure"
    ]
    assert abs(np.median(errors)) < 0.1e-3
    assert one.session.statistics.latency() > 0.005


def test_twenty_thousand_bad_datagrams_are_counted_and_move_nothing(stack: ExitStack) -> None:
    ports, frames, poses = (free_port(), free_port()), [], []
    tracker = Tracker("y", Pose(), PoseValidator())

    def take(received: Received) -> None:
        frames.append(received)
        poses.extend(
            body
            for body in tracker.bodies(received.frame, received.exposed / 1e9, received.received / 1e9)
            if body.valid and body.id == 1
        )

    there = stack.enter_context(server(ports, transport="unicast", version=(3, 0)))
    one = stack.enter_context(NatNetClient(ClientSettings(command_port=ports[0]), take))
    wait(lambda: len(frames) > 20)
    random = np.random.default_rng(0)
    everything = one.session._codec.encode_frame(Sample(1).frame())
    endpoint = one._command.getsockname()[1]
    for number in range(20_000):
        datagram = bytearray(one.session._codec.encode_frame(frames[-1].frame) if number % 2 else everything)
        for _ in range(int(random.integers(1, 4))):
            datagram[int(random.integers(0, len(datagram)))] = int(random.integers(0, 256))
        cut = int(random.integers(0, len(datagram))) if number % 5 == 0 else len(datagram)
        (there._command, there._data)[number % 2].sendto(  # those of a stranger are not looked into
            random.bytes(cut) if number % 7 == 0 else datagram[:cut],
            ("127.0.0.1", (ports[1], endpoint, ports[0])[number % 3]),
        )
    before = len(frames)
    wait(lambda: len(frames) > before + 60 and one.health().level == OK)
    assert sum(one.session.statistics.refused.values()) > 5_000
    steps = [math.dist(a.pose.position, b.pose.position) for a, b in itertools.pairwise(poses)]
    assert len(poses) > 60 and max(steps) < 0.3  # at most what the largest speed allows in the time that is believed


@pytest.mark.parametrize("transport", ["multicast", "unicast"])
@pytest.mark.parametrize("source", ["127.0.0.5", "127.0.0.1"])
def test_of_a_stranger_nothing_is_taken_and_its_address_is_logged_once(
    transport: str, source: str, stack: ExitStack, caplog: pytest.LogCaptureFixture
) -> None:
    ports, frames, models = (free_port(), free_port()), [], []
    stack.enter_context(server(ports, transport=transport))
    settings = ClientSettings(command_port=ports[0], local="127.0.0.1")
    one = stack.enter_context(NatNetClient(settings, frames.append, models.append))
    wait(lambda: len(frames) > 20 and len(models) > 0)
    before, codec, session = len(models), one.session._codec, one.session
    forged = frames[-1].frame._replace(number=frames[-1].frame.number + 1_000_000)
    endpoint = one._command.getsockname()[1]
    said = [
        codec.encode_model(ServerModel(())),
        packet(NatNetMessage.RESPONSE, b"4.1"),
        packet(NatNetMessage.DISCONNECT_BY_TIMEOUT),
    ]
    out = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    out.bind((source, 0))
    for number in range(300):
        datagrams = [codec.encode_frame(forged._replace(number=forged.number + number)), *said]
        for datagram, port in itertools.product(datagrams, (endpoint, ports[1])):
            out.sendto(datagram, ("127.0.0.1", port))
            if transport == "multicast":
                out.sendto(datagram, (session.info.group, port))
        time.sleep(0.001)
    wait(lambda: session.statistics.refused["stranger"] > 600)
    count = len(frames)
    wait(lambda: len(frames) > count + 60)
    assert max(received.frame.number for received in frames) < forged.number
    assert (len(models), session.statistics.restarts, session.statistics.connects) == (before, 0, 1)
    assert [text for text in caplog.messages if "are refused" in text] == [
        f"packets of {source}:{out.getsockname()[1]} are refused: only 127.0.0.1:{ports[0]} is accepted (reported once)"
    ]


def test_a_server_that_restarts_at_its_address_is_believed_though_its_frames_come_from_another_port(
    stack: ExitStack,
) -> None:
    ports, frames = (free_port(), free_port()), []
    one = stack.enter_context(client(ports, frames))
    for _ in range(2):
        with server(ports, transport="unicast") as there:
            before = len(frames)
            wait(lambda before=before: len(frames) > before + 30)
            assert one._frames_from == there._data.getsockname()[1]


def test_the_sockets_of_a_client_are_bound_to_the_address_that_faces_the_server(stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    stack.enter_context(server(ports, transport="unicast"))
    one = stack.enter_context(client(ports, frames))
    wait(lambda: len(frames) > 5)
    assert {bound.getsockname()[0] for bound in (one._command, *one._data)} == {"127.0.0.1"}


def test_a_port_that_is_taken_is_an_error(stack: ExitStack) -> None:
    ports = free_port(), free_port()
    stack.enter_context(server(ports))
    with pytest.raises(HricError, match=f"UDP port {ports[0]}"):
        server(ports)


def test_a_network_that_cannot_be_reached_is_reported(stack: ExitStack) -> None:
    ports, frames = (free_port(), free_port()), []
    stack.enter_context(server(ports))
    one = stack.enter_context(client(ports, frames, local="203.0.113.9"))
    wait(lambda: one.session.info is not None and one.health().level == ERROR and "203.0.113.9" in one.health().text)
