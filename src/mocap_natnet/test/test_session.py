"""Client and emulated Motive on a simulated network: any order of messages, any fault, any bitstream."""

import sys
from pathlib import Path

import numpy as np
import pytest

from mocap_natnet.client import ClientSettings
from mocap_natnet.client.client import ERROR, OK, health
from mocap_natnet.codec import Codec
from mocap_natnet.codec.packets import NatNetMessage, ServerInfo, encode_server_info, packet
from mocap_natnet.server import CameraFaults, Motive, SceneBody, ServedScene, SinusoidSource
from mocap_natnet.server import MotiveSettings as ServerSettings

sys.path.insert(0, str(Path(__file__).parent))
from natnet_link import NS, START, Link, one_body
from natnet_samples import VERSIONS


@pytest.mark.parametrize("transport", ["multicast", "unicast"])
@pytest.mark.parametrize("version", VERSIONS, ids=lambda version: f"{version[0]}.{version[1]}")
def test_every_frame_of_every_bitstream_arrives(version: tuple[int, int], transport: str) -> None:
    link = Link(one_body(version=version, transport=transport))
    link.run(1.0)
    numbers = [received.frame.number for received in link.frames]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert len(numbers) > 230
    assert link.session.statistics.lost == 0
    assert link.session.model is not None and link.session.model.bodies[1].name == "marker"
    assert health(link.session, "10.0.0.1", link.now).level == OK


def test_a_client_that_starts_before_the_server_connects_when_it_comes() -> None:
    link = Link(one_body())
    link.serving = False
    link.run(2.0)
    state = health(link.session, "10.0.0.1", link.now)
    assert state.level == ERROR and "command channel silent: 10.0.0.1:1510" in state.text
    link.replace(one_body())
    link.serving = True
    link.run(1.0)
    assert health(link.session, "10.0.0.1", link.now).level == OK


@pytest.mark.parametrize("transport", ["multicast", "unicast"])
def test_a_server_that_restarts_is_found_again_within_a_second(transport: str) -> None:
    link = Link(one_body(transport=transport))
    link.run(2.0)
    link.serving = False
    link.run(1.0)
    assert "silent" in health(link.session, "10.0.0.1", link.now).text
    link.replace(one_body(transport=transport, epoch=9000.0))
    link.serving, before = True, len(link.frames)
    link.run(1.0)
    assert len(link.frames) - before > 60
    assert link.session.statistics.restarts == 1
    assert health(link.session, "10.0.0.1", link.now).level == OK
    late = link.frames[-1]
    assert late.means == "mid-exposure"
    assert late.exposed == pytest.approx(START + (link.begin + late.frame.number / 240) * NS, abs=0.2e6)


@pytest.mark.parametrize("versions", [((4, 1), (3, 0)), ((3, 0), (4, 1)), ((4, 0), (4, 2)), ((4, 2), (2, 9))])
@pytest.mark.parametrize("flagged", [True, False], ids=["said", "unsaid"])
def test_another_bitstream_in_mid_stream_is_followed(
    versions: tuple[tuple[int, int], tuple[int, int]], flagged: bool
) -> None:
    link = Link(one_body(version=versions[0]))
    link.run(1.0)
    if flagged:
        link.motive.change_version(versions[1])
    else:
        link.motive._version = versions[1]
    link.run(1.0)
    before = len(link.frames)
    link.run(1.0)
    assert link.session.info is not None and link.session.info.version == versions[1]
    assert len(link.frames) - before > 230


def test_a_client_may_request_an_older_bitstream_by_unicast() -> None:
    link = Link(one_body(version=(4, 1), transport="unicast"), ClientSettings(bitstream=(3, 1)))
    link.run(0.5)
    assert link.session.info is not None and link.session.info.version == (3, 1)
    assert len(link.frames) > 80


def test_an_unknown_bitstream_is_refused_in_words() -> None:
    link = Link(one_body())
    link.serving = False
    link.run(0.1)
    info = ServerInfo("Motive", (9, 0, 0, 0), (5, 0), 10_000_000, 1511, True, "239.255.42.99")
    link.session.receive(packet(NatNetMessage.SERVERINFO, encode_server_info(info)), link.now)
    state = health(link.session, "10.0.0.1", link.now)
    assert state.level == ERROR and "5.0" in state.text and "2.5 to 4.5" in state.text
    assert link.session.statistics.refused["version"] == 1


def test_lost_frames_are_counted() -> None:
    link = Link(one_body(loss=0.1, seed=3))
    link.motive.delay = lambda number: 0.0055  # type: ignore[method-assign]
    link.run(0.5)
    datagrams = iter(range(10**9))
    link.keep = lambda datagram: (
        None if datagram[0] == NatNetMessage.FRAMEOFDATA and next(datagrams) % 10 == 0 else datagram
    )
    link.run(1.0)
    assert 20 <= link.session.statistics.lost <= 26


def test_frames_that_come_twice_or_late_are_used_once() -> None:
    link = Link(one_body())
    link.run(0.5)
    session, codec = link.session, Codec((4, 1))
    before = len(link.frames)
    for frame in (link.frames[-1], link.frames[-3]):
        session.receive(codec.encode_frame(frame.frame), link.now)
    assert len(link.frames) == before
    assert session.statistics.refused["duplicate"] == 1 and session.statistics.refused["late"] == 1


def test_a_single_frame_with_a_wrong_number_does_not_restart_the_stream() -> None:
    link = Link(one_body())
    link.run(0.5)
    restarts = link.restarts
    for number in (10**6, 5, -(10**6)):
        link.session.receive(Codec((4, 1)).encode_frame(link.frames[-1].frame._replace(number=number)), link.now)
        link.run(0.05)
    assert link.restarts == restarts and link.session.statistics.lost == 0
    assert all(received.frame.number < 1000 for received in link.frames)


def test_a_changed_description_is_requested() -> None:
    link = Link(one_body())
    link.run(0.5)
    link.motive.change_scene(ServedScene((SceneBody("hand", SinusoidSource()), SceneBody("tool", SinusoidSource(), 2))))
    link.run(0.2)
    assert link.session.model is not None and {body.name for body in link.session.model.bodies.values()} == {
        "hand",
        "tool",
    }


@pytest.mark.parametrize(
    ("server", "client", "words"),
    [
        ({"group": "239.1.1.1"}, {"group": "239.2.2.2"}, ["239.1.1.1", "239.2.2.2"]),
        ({"transport": "unicast"}, {"transport": "multicast"}, ["by unicast"]),
        ({"transport": "multicast"}, {"transport": "unicast"}, ["streams to a group"]),
        ({"data_port": 1600}, {"data_port": 1700}, ["1600", "1700"]),
        ({}, {}, ["live", "local"]),
    ],
)
def test_a_silent_data_channel_is_explained(server: dict, client: dict, words: list[str]) -> None:
    link = Link(one_body(**server), ClientSettings(**client))
    link.keep = lambda datagram: None if datagram[0] == NatNetMessage.FRAMEOFDATA else datagram
    link.run(2.0)
    state = health(link.session, "10.0.0.1", link.now)
    assert state.level == ERROR and state.text.startswith("data channel silent")
    assert all(word in state.text for word in words), state.text


def test_times_are_those_of_the_exposure_under_drift_and_a_busy_network() -> None:
    link = Link(one_body(drift=50.0, latency=0.0055, jitter=0.001), transit=(40e-6, 60e-6))
    link.run(25.0)
    used = [received for received in link.frames if received.means == "mid-exposure"]
    assert len(used) > 0.99 * len(link.frames)
    errors = np.array([received.exposed - START - received.frame.number / 240 * NS for received in used]) / NS
    assert np.median(np.abs(errors)) < 0.1e-3
    assert np.abs(errors).max() < 1e-3
    assert link.session.clock.echo is not None and link.session.clock.echo.drift == pytest.approx(50.0, abs=5.0)


def test_without_exposure_times_the_nominal_latency_is_taken_off() -> None:
    for settings, means in (({"exposure_known": False}, "transmission"), ({"version": (2, 10)}, "time stamp")):
        link = Link(one_body(**settings))
        link.run(2.0)
        errors = [received.exposed - START - received.frame.number / 240 * NS for received in link.frames[100:]]
        assert {received.means for received in link.frames[100:]} == {means}
        assert np.abs(errors).max() < 0.2e6


def test_damaged_datagrams_do_no_harm_and_the_stream_goes_on() -> None:
    random = np.random.default_rng(4)

    def damage(datagram: bytes) -> bytes:
        if random.random() < 0.5:
            return datagram
        changed = bytearray(datagram)
        for _ in range(3):
            changed[int(random.integers(0, len(changed)))] = int(random.integers(0, 256))
        return bytes(changed[: int(random.integers(0, len(changed) + 1))] if random.random() < 0.3 else changed)

    link = Link(
        Motive(ServerSettings(), ServedScene((SceneBody("marker", SinusoidSource()),), (), CameraFaults(noise=1e-4)))
    )
    link.run(0.5)
    link.keep = damage
    link.run(3.0)
    link.keep = lambda datagram: datagram
    link.run(0.6)
    before = len(link.frames)
    link.run(0.5)
    assert len(link.frames) - before > 115
    refused = link.session.statistics.refused
    assert sum(refused.values()) > 50 and "length" in refused
    assert health(link.session, "10.0.0.1", link.now).level == OK
