"""Faults between client and server on real sockets are overcome or reported within two seconds; stamps are right."""

import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from real_master import free_port

from mocap_natnet.client import ClientSettings, NatNetClient, Received
from mocap_natnet.client.client import ERROR, OK
from mocap_natnet.server import Motive, MotiveServer, SceneBody, ServedScene, SinusoidSource
from mocap_natnet.server import MotiveSettings as ServerSettings

sys.path.insert(0, str(Path(__file__).parent))
from motive_process import motive

pytestmark = pytest.mark.alone

PATIENCE = 30.0
"""Time-out of waiting, for a busy machine [s]."""
each_limit = pytest.mark.parametrize("limit", [PATIENCE, pytest.param(2.0, marks=pytest.mark.live)])
"""Permitted time until a fault is overcome or reported: on any machine, and on an idle one [s]."""

Ports = tuple[int, int]
Figure = Callable[[str, float, str], None]


def ports() -> Ports:
    return free_port(), free_port()


def words(where: Ports, *more: str) -> tuple[str, ...]:
    """Return the arguments of the server's command."""
    return ("--command-port", str(where[0]), "--data-port", str(where[1]), *more)


def client(where: Ports, frames: list[Received], **settings: object) -> NatNetClient:
    return NatNetClient(ClientSettings(**{"command_port": where[0], "local": "127.0.0.1", **settings}), frames.append)


def seconds_until(condition: Callable[[], bool]) -> float:
    begin = time.monotonic()
    while not condition():
        assert time.monotonic() < begin + PATIENCE, "waited too long"
        time.sleep(0.01)
    return time.monotonic() - begin


def says(one: NatNetClient, *parts: str) -> bool:
    state = one.health()
    return state.level == ERROR and all(part in state.text for part in parts)


def receives(one: NatNetClient, frames: list[Received]) -> Callable[[], bool]:
    """Return a condition: from now on, frames arrive again and the client's health is good."""
    before = len(frames)
    return lambda: len(frames) > before + 20 and one.health().level == OK


# -- the server --------------------------------------------------------------------------------------------------------


@each_limit
@pytest.mark.parametrize("transport", ["multicast", "unicast"])
def test_a_server_that_is_killed_is_missed_and_one_that_comes_in_its_place_is_found(
    transport: str, limit: float, figure: Figure
) -> None:
    where, frames = ports(), []
    with client(where, frames) as one:
        with motive(*words(where, "--transport", transport)) as process:
            seconds_until(receives(one, frames))
            process.kill()
            missed = seconds_until(
                lambda: says(one, "command channel silent", f"127.0.0.1:{where[0]} does not respond")
            )
        with motive(*words(where, "--transport", transport, "--bitstream", "3.1")):
            found = seconds_until(receives(one, frames))
        seconds_until(lambda: one.health().level == ERROR)
    figure(f"NatNet {transport}: a killed server is missed (limit {limit:g} s) after", missed, "s")
    figure(f"NatNet {transport}: one in its place is found (limit {limit:g} s) after", found, "s")
    assert max(missed, found) <= limit


@each_limit
@pytest.mark.parametrize("transport", ["multicast", "unicast"])
def test_a_bitstream_that_changes_in_mid_stream_is_followed(transport: str, limit: float) -> None:
    where, frames = ports(), []
    settings = ServerSettings(command_port=where[0], data_port=where[1], transport=transport)
    with (
        MotiveServer(Motive(settings, ServedScene((SceneBody("marker", SinusoidSource()),)))) as server,
        client(where, frames) as one,
    ):
        seconds_until(receives(one, frames))
        server.motive.change_version((3, 0))
        followed = seconds_until(lambda: one.session.info.version == (3, 0)) + seconds_until(receives(one, frames))
    assert followed <= limit


# -- the settings ------------------------------------------------------------------------------------------------------


@each_limit
def test_a_wrong_address_is_explained(limit: float) -> None:
    where = ports()
    with motive(*words(where)), client(where, [], server="127.0.0.77") as one:
        explained = seconds_until(lambda: says(one, f"127.0.0.77:{where[0]} does not respond", "address", "firewall"))
    assert explained <= limit


WRONG = {
    "group": (
        ["--group", "239.1.1.1"],
        {"group": "239.2.2.2"},
        ["239.1.1.1", "239.2.2.2", "correct or leave out the group"],
    ),
    "data port": (
        ["--transport", "unicast", "--unicast-to", "data_port"],
        {"data_port": "another"},
        ["correct or leave out the data port"],
    ),
    "unicast": (
        ["--transport", "multicast"],
        {"transport": "unicast"},
        ["it streams to a group while unicast is requested"],
    ),
}


@each_limit
@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_setting_of_the_data_channel_is_explained(wrong: str, limit: float) -> None:
    server, settings, parts = WRONG[wrong]
    where = ports()
    settings = {"data_port": free_port()} if "data_port" in settings else settings
    with motive(*words(where, *server)), client(where, [], **settings) as one:
        explained = seconds_until(lambda: says(one, "data channel silent", *parts))
    assert explained <= limit


@each_limit
def test_frames_that_come_by_the_command_channel_are_taken_though_multicast_is_requested(limit: float) -> None:
    where, frames = ports(), []
    with motive(*words(where, "--transport", "unicast")), client(where, frames, transport="multicast") as one:
        assert seconds_until(receives(one, frames)) <= limit


# -- stamps ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seconds", [3.0, pytest.param(60.0, marks=pytest.mark.live)])
def test_each_stamp_is_that_of_its_exposure_in_spite_of_drift_and_latency(seconds: float) -> None:
    """Frames are compared from the first used one on, with the stream's time by the clock that both ends share here."""
    where, frames = ports(), []
    settings = ServerSettings(command_port=where[0], data_port=where[1], drift=50.0, latency=0.0055)
    with ExitStack() as stack:
        server = stack.enter_context(
            MotiveServer(Motive(settings, ServedScene((SceneBody("marker", SinusoidSource()),))))
        )
        one = stack.enter_context(client(where, frames))
        seconds_until(lambda: len(frames) > 0)
        time.sleep(seconds)
        errors = np.array(
            [received.exposed * 1e-9 - server.robot_time(received.frame.number / 240) for received in frames[:-1]]
        )
        assert one.session.clock.echo.restarts == 0
    assert len(errors) > 0.5 * 240 * seconds
    assert np.median(np.abs(errors)) <= 0.1e-3
    assert np.abs(errors).max() <= 1e-3


FLOOD = """import socket, sys
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
    while True:
        out.sendto(bytes((4, 0, 0, 0)), ("127.0.0.1", int(sys.argv[1])))"""
"""Program that sends requests without end."""


def test_a_flood_of_requests_stops_no_stream() -> None:
    settings = ServerSettings(command_port=free_port(), data_port=free_port())
    scene = ServedScene((SceneBody("marker", SinusoidSource()),))
    with MotiveServer(Motive(settings, scene)) as server, ExitStack() as stack:
        for _ in range(2):
            stack.callback(subprocess.Popen([sys.executable, "-c", FLOOD, str(settings.command_port)]).kill)
        time.sleep(1.0)
        before = server.sent
        time.sleep(2.0)
        assert server.sent - before > 100
