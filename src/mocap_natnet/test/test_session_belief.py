"""Which datagrams a client uses: none that it did not request, none before the clock is known; all are counted."""

import sys
from pathlib import Path

import pytest

from mocap_natnet.client.client import OK, health
from mocap_natnet.codec import Codec
from mocap_natnet.codec.packets import NatNetMessage, ServerInfo, encode_server_info, packet
from mocap_natnet.server import Motive, SceneBody, ServedScene, SinusoidSource
from mocap_natnet.server import MotiveSettings as ServerSettings

sys.path.insert(0, str(Path(__file__).parent))
from natnet_link import NS, START, Link, one_body


def test_each_datagram_is_counted_as_taken_or_refused() -> None:
    link = Link(one_body())
    link.run(1.0)
    link.session.receive(b"", link.now)
    taken, refused = link.session.statistics.taken, link.session.statistics.refused
    assert (
        taken["FRAMEOFDATA"] == len(link.frames)
        and taken["MODELDEF"] == taken["SERVERINFO"] == 1
        and taken["ECHO_RESPONSE"] > 10
    )
    assert dict(refused) == {"short": 1}


def other_server(version: tuple[int, int] = (3, 0), **changes: object) -> bytes:
    info = ServerInfo("Motive", (3, 1, 0, 0), version, 10_000_000, 1511, True, "239.255.42.99")._replace(**changes)
    return packet(NatNetMessage.SERVERINFO, encode_server_info(info))


@pytest.mark.parametrize("version", [(3, 0), (9, 9)])
def test_server_information_without_a_request_is_requested_before_it_counts(version: tuple[int, int]) -> None:
    link = Link(one_body())
    link.run(1.0)
    restarts = link.restarts
    link.session.receive(other_server(version), link.now)
    link.run(0.5)
    assert link.session.statistics.refused == {"unasked": 1} and link.session.statistics.taken["SERVERINFO"] == 2
    assert link.restarts == restarts and link.session.statistics.lost == 0
    assert health(link.session, "10.0.0.1", link.now).level == OK


def test_the_complaint_about_a_bitstream_ends_when_the_server_speaks_another() -> None:
    link = Link(one_body())
    link.run(0.5)
    link.session.poll(link.now)
    link.session._connecting = True
    link.session.receive(other_server((9, 9)), link.now)
    assert "9.9" in link.session.complaint
    link.run(0.5)
    assert link.session.complaint == "" and health(link.session, "10.0.0.1", link.now).level == OK


def test_a_description_that_was_not_requested_changes_nothing() -> None:
    link = Link(one_body())
    link.run(0.5)
    other = Motive(ServerSettings(), ServedScene((SceneBody("stranger", SinusoidSource()),)))
    link.session.receive(Codec((4, 1)).encode_model(other.scene.model()), link.now)
    assert link.session.model is not None and link.session.model.bodies[1].name == "marker"
    assert link.session.statistics.refused == {"unasked": 1}


def test_a_body_that_the_description_lacks_makes_the_client_request_it_again() -> None:
    link = Link(one_body())
    link.run(0.5)
    link.motive.scene = ServedScene(
        (SceneBody("hand", SinusoidSource()), SceneBody("tool", SinusoidSource(), 2))
    )  # and no frame says so
    link.run(0.6)
    assert link.session.model is not None and {body.name for body in link.session.model.bodies.values()} == {
        "hand",
        "tool",
    }


def test_a_clock_frequency_that_was_misread_is_requested_again() -> None:
    link = Link(one_body())
    link.keep = lambda datagram: (
        other_server((4, 1), clock_frequency=9_000_000) if datagram[0] == NatNetMessage.SERVERINFO else datagram
    )
    link.run(0.1)
    link.keep = lambda datagram: datagram
    link.run(2.0)
    assert link.session.info is not None and link.session.info.clock_frequency == 10_000_000
    late = link.frames[-1]
    assert late.means == "mid-exposure" and late.exposed == pytest.approx(
        START + late.frame.number / 240 * NS, abs=0.2e6
    )


# -- the clock ---------------------------------------------------------------------------------------------------------


def test_no_frame_is_used_before_an_echo_gave_the_servers_clock_within_a_millisecond() -> None:
    link = Link(one_body(drift=50.0), transit=(100e-6, 3e-3))
    link.run(3.0)
    errors = [abs(received.exposed - START - received.frame.number / 240 * NS) for received in link.frames]
    assert max(errors) < 1e6
    assert {received.means for received in link.frames} == {"mid-exposure"}
    assert link.session.statistics.refused["before the clock is known"] > 0


def test_the_first_frames_of_a_server_that_restarts_have_right_times_too() -> None:
    link = Link(one_body())
    link.run(2.0)
    link.frames.clear()
    link.replace(one_body(epoch=9000.0))
    link.run(1.0)
    errors = [
        abs(received.exposed - START - (link.begin + received.frame.number / 240) * NS)
        for received in link.frames
        if received.frame.number < 300
    ]
    assert len(errors) > 200 and max(errors) < 1e6


def test_where_no_echo_is_good_enough_frames_are_used_after_a_second() -> None:
    link = Link(one_body(), transit=(4e-3, 0.0))
    link.run(3.0)
    assert link.session.statistics.refused["before the clock is known"] == pytest.approx(240, abs=10)
    assert len(link.frames) == pytest.approx(2 * 240, abs=20)
    assert health(link.session, "10.0.0.1", link.now).level == OK


def test_where_no_echo_comes_frames_are_used_after_a_second_and_it_is_said() -> None:
    link = Link(one_body())
    link.keep = lambda datagram: None if datagram[0] == NatNetMessage.ECHO_RESPONSE else datagram
    link.run(2.0)
    assert len(link.frames) == pytest.approx(240, abs=10)
    assert "does not respond to clock echoes" in health(link.session, "10.0.0.1", link.now).text


def test_a_server_without_a_clock_is_waited_for_not_at_all() -> None:
    link = Link(one_body(version=(2, 10)))
    link.run(0.5)
    assert len(link.frames) > 110 and "before the clock is known" not in link.session.statistics.refused
