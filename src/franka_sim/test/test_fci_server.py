"""The server to a client in plain Python: life of a motion, clocks, bad clients. The robot's state is constant."""

import logging
import socket
import struct
import threading
import time
from contextlib import ExitStack, suppress

import pytest
from fci_peer import ARM, PATIENCE, Peer, command, new_address, serving

from franka_sim.box.requests import MotionCommand
from franka_sim.fci.clock import LockStepClock, MotionPhase, PeriodicClock, make_clock
from franka_sim.fci.complaints import MAX_PEERS, PEER_QUIET, Complaints
from franka_sim.fci.connection import MAX_UNSENT
from franka_sim.fci.device import ConstantDevice
from franka_sim.fci.faults import NetworkFaults
from franka_sim.fci.server import FciArm, FciServer
from franka_sim.fci.session import HANDSHAKE_TIME, MAX_WAITING
from hric_core.errors import HricError, ParameterError, UnknownNameError

VERSIONS = pytest.mark.parametrize("version", [5, 10])
STOP, RECOVER_V5, LIBRARY, URDF = 2, 12, 13, 11


class Recorder(ConstantDevice):
    """Device that stores the commands that it gets."""

    def __init__(self) -> None:
        super().__init__()
        self.commands: list[MotionCommand | None] = []
        self.lost_clients = 0

    def cycle(self, command: MotionCommand | None) -> None:
        self.commands.append(command)
        super().cycle(command)

    def connection_lost(self) -> None:
        self.lost_clients += 1
        super().connection_lost()


def torques(device: Recorder) -> list[float]:
    return [given.tau[0] for given in device.commands if given is not None]


@VERSIONS
def test_states_come_in_order_one_millisecond_after_the_other(version: int) -> None:
    with serving(ConstantDevice(), version) as ip, Peer(ip, version) as peer:
        ids = [struct.unpack_from("<Q", peer.state())[0] for _ in range(50)]
    assert ids == list(range(ids[0], ids[0] + 50))


@VERSIONS
def test_another_version_gets_the_right_one_and_the_box_is_free_again(version: int) -> None:
    with serving(ConstantDevice(), version) as ip:
        with Peer(ip, version, connect=False) as wrong:
            response = wrong.exchange(0, struct.pack("<HH", version + 1, 50000))
            assert response == struct.pack("<BH", 1, version)
            assert wrong.tcp.recv(1) == b""
        with Peer(ip, version) as peer:
            peer.state()


def test_a_second_client_is_turned_away_and_the_first_one_served_on() -> None:
    with serving(ConstantDevice()) as ip, Peer(ip) as first:
        with pytest.raises(OSError):
            Peer(ip).close()
        before = first.message_id
        assert struct.unpack_from("<Q", first.newest_state())[0] > before


def test_a_client_that_comes_as_another_one_goes_is_served() -> None:
    with serving(ConstantDevice()) as ip:
        for _ in range(20):
            with Peer(ip) as peer:
                peer.state()


def test_a_connection_that_says_nothing_is_closed() -> None:
    with serving(ConstantDevice()) as ip:
        silent = [Peer(ip, connect=False) for _ in range(MAX_WAITING)]
        begin = time.monotonic()
        assert all(peer.tcp.recv(1) == b"" for peer in silent)
        assert time.monotonic() - begin < HANDSHAKE_TIME + PATIENCE
        with Peer(ip) as peer:
            peer.state()


def test_one_that_says_nothing_gives_way_to_the_next_and_those_of_another_address_stay() -> None:
    with serving(ConstantDevice()) as ip, ExitStack() as stack:

        def connect(source: str) -> socket.socket:
            return stack.enter_context(socket.create_connection((ip, ARM), PATIENCE, (source, 0)))

        other, crowd = connect("127.0.0.8"), [connect("127.0.0.9") for _ in range(MAX_WAITING)]
        begin = time.monotonic()
        assert crowd[0].recv(1) == b""
        assert time.monotonic() - begin < PATIENCE / 2
        other.settimeout(0.0)
        with suppress(BlockingIOError):
            assert other.recv(1) != b"" or time.monotonic() - begin > HANDSHAKE_TIME


@pytest.mark.parametrize("said", [b"", bytes(1)])
def test_a_crowd_that_says_nothing_or_one_byte_at_a_time_locks_nobody_out(said: bytes) -> None:
    ended = threading.Event()

    def crowd(ip: str) -> None:
        idle: list[socket.socket] = []
        while not ended.wait(0.005):
            with suppress(OSError):
                idle.append(socket.create_connection((ip, ARM), 1.0))
            for one in idle[-5:]:
                with suppress(OSError):
                    one.send(said)
            if len(idle) > 100:
                idle.pop(0).close()
        for one in idle:
            one.close()

    with serving(ConstantDevice()) as ip:
        strangers = [threading.Thread(target=crowd, args=(ip,)) for _ in range(2)]
        for stranger in strangers:
            stranger.start()
        try:
            for _ in range(10):
                with Peer(ip) as peer:
                    first = peer.state()
                    assert peer.state() != first
        finally:
            ended.set()
            for stranger in strangers:
                stranger.join()


def test_each_address_that_attacks_is_logged_once_for_as_long_as_it_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    sources = ["127.0.0.8", "127.0.0.9", "127.0.0.10"]
    attacks = [b"", bytes(64), b"\xff" * 64]

    def strike(ip: str) -> None:
        for source, said in zip(sources, attacks, strict=True):
            with socket.create_connection((ip, ARM), PATIENCE, (source, 0)) as stranger, suppress(OSError):
                stranger.send(said)
                stranger.settimeout(PATIENCE)
                while stranger.recv(64):
                    pass

    with serving(ConstantDevice()) as ip:
        strike(ip)
        with Peer(ip) as peer:
            peer.state()
            strike(ip)
        strike(ip)
    assert [caplog.text.count(f"{source}:") for source in sources] == [1, 1, 1], caplog.text


def test_clients_that_leave_at_once_are_logged_once_for_as_long_as_it_goes_on(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "hric.franka_sim.fci")
    with serving(ConstantDevice()) as ip:
        for _ in range(5):
            with Peer(ip) as peer:
                peer.state()
        with Peer(ip) as peer:  # waits until the box has noticed that the last one has gone
            peer.state()
        assert caplog.text.count("is connected") == 1, caplog.text
        assert caplog.text.count("connected for less than 1 s, has left") == 1, caplog.text


def test_a_flood_of_addresses_grows_neither_memory_nor_log(caplog: pytest.LogCaptureFixture) -> None:
    now = [0.0]
    complaints = Complaints("arm", lambda: now[0])
    for _ in range(3):
        for n in range(10 * MAX_PEERS):
            now[0] += 1e-4
            complaints.warn_of(f"10.0.{n // 256}.{n % 256}", f"10.0.{n // 256}.{n % 256} is turned away")
    assert len(complaints._peers) == MAX_PEERS
    assert len(caplog.messages) == MAX_PEERS + 1, "each of those remembered, and one line for all others"
    now[0] += PEER_QUIET
    complaints.warn_of("10.0.0.0", "10.0.0.0 is turned away")
    assert caplog.messages[-1] == "arm: 10.0.0.0 is turned away (2 more like this)"
    complaints.warn_of("10.9.9.9", "10.9.9.9 is turned away")
    assert caplog.messages[-1] == "arm: 10.9.9.9 is turned away" and len(complaints._peers) == MAX_PEERS


def test_a_client_that_reads_no_responses_is_let_go() -> None:
    with serving(ConstantDevice("x" * 100000), 10) as ip, Peer(ip, 10) as peer:
        with pytest.raises(OSError):
            for _ in range(200 + MAX_UNSENT // 10000):
                peer.request(URDF)
                time.sleep(1e-3)
        with Peer(ip, 10) as other:
            other.state()


@VERSIONS
def test_a_motion_gets_a_response_when_it_begins_and_when_it_ends(version: int) -> None:
    device = Recorder()
    with serving(device, version) as ip, Peer(ip, version) as peer:
        peer.state()
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        for k in range(10):
            peer.send(command(float(k + 1)))
            assert peer.modes(peer.state()) == (2, 2, 2)
        peer.finish()
        assert peer.response(motion) == b"\x00"
        assert peer.until_modes(0, 3, 1)
    assert torques(device) == [float(k + 1) for k in range(10)] + [0.0]


def test_the_lock_step_clock_waits_for_the_command_for_the_last_state() -> None:
    device = Recorder()
    with serving(device, pace=0.0) as ip, Peer(ip) as peer:
        peer.response(peer.move())
        peer.until_moving()
        peer.newest_state()
        for k in range(100):
            peer.send(command(2.0 * k + 1.0), peer.message_id - 1)  # for an old state
            peer.send(command(2.0 * k))
            peer.send(command(2.0 * k + 1.0), peer.message_id + 1000)  # for one that does not exist
            peer.newest_state()
    given = [one.tau[0] for one in device.commands if one is not None]
    # At the start states come by themselves, and one may be on its way while the first command is.
    assert given[-90:] == [2.0 * k for k in range(10, 100)]


def test_a_client_that_does_not_get_to_run_for_a_while_loses_no_command_in_lock_step() -> None:
    device = Recorder()
    with serving(device, pace=0.0) as ip, Peer(ip) as peer:
        peer.response(peer.move())
        peer.until_moving()
        peer.newest_state()
        for k in range(9):
            time.sleep(0.2 * (k % 3 == 1))
            peer.send(command(1.0 + k))
            peer.state()
    given = [None if c is None else c.tau[0] for c in device.commands]
    first = given.index(1.0)
    assert given[first : first + 9] == [1.0 + k for k in range(9)]


def test_a_command_that_does_not_come_is_lost_and_the_lock_step_clock_goes_on() -> None:
    device = Recorder()
    with serving(device, pace=0.0) as ip, Peer(ip) as peer:
        peer.response(peer.move())
        peer.until_moving()
        peer.newest_state()
        for k in range(6):
            if k != 3:
                peer.send(command(1.0 + k))
            peer.state()
    given = [None if c is None else c.tau[0] for c in device.commands]
    first = given.index(1.0)
    assert given[first : first + 6] == [1.0, 2.0, 3.0, None, 5.0, 6.0]


def test_the_wall_clock_waits_for_nobody() -> None:
    device = Recorder()
    with serving(device, clock="wall") as ip, Peer(ip) as peer:
        peer.response(peer.move())
        peer.until_moving()
        peer.send(command(1.0))
        for _ in range(30):
            peer.state()
        assert peer.modes(peer.state()) == (2, 2, 2)
    assert device.commands.count(None) > 30


def test_the_response_to_a_stopped_motion_comes_before_that_to_the_stop() -> None:
    with serving(ConstantDevice()) as ip, Peer(ip) as peer:
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        stop = peer.request(STOP)
        header = peer.framing.header
        responses = [(*header.unpack(peer._exactly(header.size)), peer._exactly(1)) for _ in range(2)]
    assert [(response[1], response[3]) for response in responses] == [(motion, b"\x02"), (stop, b"\x00")]


def test_a_motion_is_refused_while_another_one_runs() -> None:
    with serving(ConstantDevice()) as ip, Peer(ip) as peer:
        assert peer.response(peer.move()) == b"\x01"
        assert peer.response(peer.move()) == b"\x03"


@pytest.mark.parametrize("controller, generator", [(3, 0), (2, 4), (2, 5), (7, 0), (2**32 - 1, 2**32 - 1)])
def test_modes_that_do_not_exist_are_invalid(controller: int, generator: int) -> None:
    with serving(ConstantDevice()) as ip, Peer(ip) as peer:
        assert peer.response(peer.move(controller, generator)) == b"\x05"
        assert peer.until_modes(0, 3, 1)


def test_what_is_not_finite_is_refused_with_invalid_argument(caplog: pytest.LogCaptureFixture) -> None:
    with serving(ConstantDevice()) as ip, Peer(ip) as peer:
        assert peer.exchange(5, struct.pack("<7d", *[float("nan")] * 7)) == b"\x02"
        assert peer.exchange(5, struct.pack("<7d", *[100.0] * 7)) == b"\x00"
    assert "SetJointImpedance refused: a value in the request is not finite" in caplog.text


@VERSIONS
@pytest.mark.parametrize("moving", [False, True])
def test_a_client_that_dies_frees_the_robot(version: int, moving: bool) -> None:
    device = Recorder()
    with serving(device, version) as ip:
        for n in range(3):
            peer = Peer(ip, version)
            if moving:
                assert peer.response(peer.move()) == b"\x01"
                peer.until_moving()
                peer.send(command(1.0))
            peer.tcp.setsockopt(
                socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0)
            )  # as a killed process: a reset
            peer.close()
            end = time.monotonic() + PATIENCE
            while device.lost_clients <= n and time.monotonic() < end:
                time.sleep(1e-3)
            assert device.lost_clients == n + 1
            assert int(device.state.robot_mode) == 1


def test_a_library_that_is_not_there_is_refused_with_its_reason_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    with serving(ConstantDevice()) as ip, Peer(ip) as peer:
        assert peer.exchange(LIBRARY, b"\x00\x00") == b"\x01"
        assert peer.exchange(LIBRARY, b"\x00\x01") == b"\x01"
    assert "this robot has none" in caplog.text and "for this machine" in caplog.text


def test_a_port_that_is_taken_and_an_address_of_another_machine_are_refused_by_name() -> None:
    with serving(ConstantDevice()) as ip, pytest.raises(HricError, match=f"arm service cannot listen on {ip}:1337"):
        FciServer([FciArm(ConstantDevice(), ip)])
    with pytest.raises(HricError, match=r"cannot listen on 203\.0\.113\.1:1337"):
        FciServer([FciArm(ConstantDevice(), "203.0.113.1")])


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="valid: 10, 5"):
        FciServer([FciArm(ConstantDevice(), new_address(), 7)])
    with pytest.raises(UnknownNameError, match="lock_step, wall"):
        make_clock("sundial", 1.0)
    for name in ("wall", "lock_step"):
        with pytest.raises(ParameterError, match="; valid: a finite number"):
            make_clock(name, -1.0 if name == "lock_step" else 0.0)
    with pytest.raises(ParameterError, match=r"loss is 1\.5; valid: a finite number from 0 to 1"):
        NetworkFaults(loss=1.5)


def test_the_wall_clock_does_not_make_up_for_its_own_delays() -> None:
    clock = PeriodicClock()
    clock.ticked(10.0, MotionPhase.AWAITING)
    assert clock.left(10.0, MotionPhase.AWAITING) == pytest.approx(1e-3)
    clock.ticked(10.0012, MotionPhase.AWAITING)  # a little late: the deadlines stay
    assert clock.left(10.0012, MotionPhase.AWAITING) == pytest.approx(0.8e-3)
    clock.ticked(10.05, MotionPhase.AWAITING)
    assert clock.left(10.05, MotionPhase.AWAITING) == pytest.approx(1e-3)


def test_an_unpaced_lock_step_clock_runs_with_the_commands_and_in_real_time_without_a_motion() -> None:
    clock = LockStepClock(0.0)
    for k in range(1000):
        clock.ticked(5.0 + 1e-5 * k, MotionPhase.ARRIVED)
    now = 5.0 + 1e-2
    assert clock.left(now, MotionPhase.ARRIVED) <= 0.0
    assert 0.0 < clock.left(now, MotionPhase.IDLE) <= 1e-3
    assert clock.left(now, MotionPhase.AWAITING) > 0.4


def test_only_the_first_command_that_is_lost_is_awaited_long_and_none_on_a_network_that_loses_them() -> None:
    clock, lossy = LockStepClock(0.0), LockStepClock(0.0, lossy=True)
    for one in (clock, lossy):
        one.ticked(5.0, MotionPhase.ARRIVED)
    assert (clock.left(5.0, MotionPhase.AWAITING), lossy.left(5.0, MotionPhase.AWAITING)) == pytest.approx((0.5, 0.05))
    clock.ticked(5.5, MotionPhase.AWAITING)
    assert clock.left(5.5, MotionPhase.AWAITING) == pytest.approx(0.05)
    clock.ticked(5.51, MotionPhase.ARRIVED)
    assert clock.left(5.51, MotionPhase.AWAITING) == pytest.approx(0.5)


def test_a_bad_network_loses_the_requested_share_and_delays_the_rest() -> None:
    faults = NetworkFaults(latency=0.01, jitter=0.005, loss=0.5, seed=3)
    with serving(ConstantDevice(), faults=faults) as ip, Peer(ip) as peer:
        ids = [struct.unpack_from("<Q", peer.state())[0] for _ in range(200)]
    lost = 1.0 - len(ids) / (max(ids) - min(ids) + 1)
    assert 0.35 < lost < 0.65
    assert ids != sorted(ids), "datagrams with jitter overtake each other"


def test_a_motion_goes_through_a_slow_network() -> None:
    device = Recorder()
    with serving(device, pace=0.0, faults=NetworkFaults(latency=0.005)) as ip, Peer(ip) as peer:
        begin = time.monotonic()
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        peer.newest_state()
        for _ in range(20):
            peer.send(command(1.0))
            peer.state()
        assert time.monotonic() - begin >= 20 * 0.01
        peer.finish()
        assert peer.response(motion) == b"\x00"
    assert len(torques(device)) >= 20
