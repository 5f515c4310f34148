"""The unmodified clients to the emulated arm: plant, control box and server together."""

import json
import struct
import time
from collections.abc import Iterator

import numpy as np
import pytest
from fci_clients import HOLD_FR3, HOLD_PANDA, JUMP, MODEL, MODES_FR3, MODES_PANDA, NAN_FR3, NAN_PANDA, SETTERS
from fci_peer import PATIENCE, Peer, command, control_box, log_of, run_client, wait_for_log

from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome
from franka_sim.fci.app import ControlBoxCommand
from franka_sim.fci.robots import ROBOTS
from franka_sim.fci.wire import WIRE_ERRORS
from franka_sim.fci.world_building import make_arm
from hric_core.errors import HricError

FAST = ("--real-time-factor", "0", "--no-collision")
ROBOT = {5: "panda", 10: "fr3"}
VERSIONS = pytest.mark.parametrize("version", [5, 10])
RECOVERY = {5: 12, 10: 10}


@pytest.fixture(params=[5, 10])
def arm(request: pytest.FixtureRequest) -> Iterator[tuple[str, int]]:
    version: int = request.param
    with control_box("--robot", ROBOT[version], *FAST) as (ip, _):
        yield ip, version


def test_without_torques_libfranka_sees_the_arm_stand_still_and_no_packet_is_lost(arm: tuple[str, int]) -> None:
    ip, version = arm
    count, rate, drift = json.loads(run_client(HOLD_PANDA if version == 5 else HOLD_FR3, ip, "3000"))
    assert (count, rate) == (3000, 1.0)
    assert drift < 1e-6


@pytest.mark.slow
def test_a_minute_of_torque_control_loses_no_packet_and_the_arm_stands_still(arm: tuple[str, int]) -> None:
    ip, version = arm
    count, rate, drift = json.loads(run_client(HOLD_PANDA if version == 5 else HOLD_FR3, ip, "60000", limit=300.0))
    assert (count, rate) == (60000, 1.0)
    assert drift < 1e-6


@pytest.mark.slow
@VERSIONS
def test_a_minute_without_torques_with_friction_in_the_joints_the_arm_stands_still(version: int) -> None:
    # Gravity and friction are compensated inside: the client sends zeros.
    with control_box("--robot", ROBOT[version], *FAST, "--friction", "identified") as (ip, _):
        count, rate, drift = json.loads(run_client(HOLD_PANDA if version == 5 else HOLD_FR3, ip, "60000", limit=300.0))
    print(f"protocol {version}: drift {drift:.2e} rad in {count} cycles")
    assert (count, rate) == (60000, 1.0)
    assert drift < 1e-6


def test_the_arm_follows_each_motion_generator_of_libfranka(arm: tuple[str, int]) -> None:
    ip, version = arm
    found = json.loads(run_client(MODES_PANDA if version == 5 else MODES_FR3, ip))
    assert len(found) >= 4
    for name, moved in found.items():
        assert moved == pytest.approx(0.1, abs=0.01), name


def test_a_jump_of_the_torque_is_a_reflex_that_libfranka_names_and_recovers_from() -> None:
    with control_box(*FAST) as (ip, process):
        lines = run_client(JUMP, ip).splitlines()
        assert "controller_torque_discontinuity" in log_of(process)
    assert "aborted by reflex" in lines[0] and "controller_torque_discontinuity" in lines[0]
    assert "command not possible in the current mode" in lines[1] and "Reflex" in lines[1]
    assert lines[2] == "RobotMode.kReflex"
    assert lines[3].startswith("RobotMode.kIdle []") and "controller_torque_discontinuity" in lines[3]


@VERSIONS
def test_numbers_that_are_none_stop_the_motion_by_name(version: int) -> None:
    with control_box("--robot", ROBOT[version], *FAST) as (ip, process), Peer(ip, version) as peer:
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        peer.newest_state()
        peer.send(command())
        peer.state()
        peer.send(command(float("nan")))
        state = peer.state()
        assert peer.modes(state) == (0, 3, 4)
        for flags in peer.flags(state):
            assert [name for name, flag in zip(WIRE_ERRORS, flags, strict=True) if flag] == [
                "controller_torque_discontinuity"
            ]
        assert "controller_torque_discontinuity" in log_of(process)
        assert peer.response(motion) == bytes([6 if version == 5 else 8])
        assert peer.response(peer.move()) == bytes([3 if version == 5 else 5]), "refused until the recovery"
        assert peer.exchange(RECOVERY[version]) == b"\x00"
        assert peer.until_modes(1)


@VERSIONS
def test_a_number_that_is_none_is_refused_by_libfranka_itself_and_the_next_motion_runs(version: int) -> None:
    with control_box("--robot", ROBOT[version], *FAST) as (ip, process):
        message, count = run_client(NAN_PANDA if version == 5 else NAN_FR3, ip).splitlines()
        assert "NaN" in message or "invalid" in message.lower()
        assert count == "100"
        assert "reflex" not in log_of(process)


def success_rate(state: bytes, version: int) -> float:
    layout = "<d" if version == 5 else "<f"
    rate: float = struct.unpack(layout, state[-struct.calcsize(layout) :])[0]
    return rate


@VERSIONS
@pytest.mark.parametrize("clock", ["lock_step", "wall"])
def test_twenty_lost_commands_end_the_motion_by_name(version: int, clock: str) -> None:
    factor = () if clock == "wall" else ("--real-time-factor", "0")
    with (
        control_box("--robot", ROBOT[version], "--no-collision", "--clock", clock, *factor) as (ip, process),
        Peer(ip, version) as peer,
    ):
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        peer.send(command())
        while not success_rate(peer.state(), version):  # by the wall clock a command may come too late
            peer.send(command())
        while peer.modes(state := peer.state())[2] == 2:
            pass
        reflex = peer.flags(state)[1]
        assert [name for name, flag in zip(WIRE_ERRORS, reflex, strict=True) if flag] == [
            "communication_constraints_violation"
        ]
        assert peer.response(motion) == bytes([6 if version == 5 else 8])
        wait_for_log(process, "communication_constraints_violation")


@VERSIONS
def test_the_user_stop_ends_the_motion_and_refuses_the_next_until_it_is_released(version: int) -> None:
    aborted, refused = (7, 3) if version == 5 else (9, 5)
    with control_box("--robot", ROBOT[version], *FAST, "--console") as (ip, process), Peer(ip, version) as peer:
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        peer.send(command())
        assert process.stdin is not None
        process.stdin.write("user_stop on\n")
        process.stdin.flush()
        assert peer.response(motion) == bytes([aborted])
        assert peer.until_modes(5)
        assert peer.response(peer.move()) == bytes([refused])
        process.stdin.write("user_stop off\n")
        process.stdin.flush()
        wait_for_log(process, "console: user_stop off")
        assert peer.response(peer.move()) == b"\x01"


def test_a_push_shows_in_the_external_wrench_and_a_hard_one_is_a_reflex() -> None:
    with control_box(*FAST, "--console") as (ip, process), Peer(ip) as peer:
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        peer.newest_state()
        assert process.stdin is not None
        process.stdin.write("push panda_link7 0 0 -300 1\n")
        process.stdin.flush()
        wait_for_log(process, "console: push")
        while peer.modes(state := peer.newest_state())[2] == 2:
            peer.send(command())
        named = {name for name, flag in zip(WIRE_ERRORS, peer.flags(state)[1], strict=True) if flag}
        assert named & {"joint_reflex", "cartesian_reflex"}, named
        assert peer.response(motion) == b"\x06"


def test_a_killed_client_leaves_the_arm_holding_and_free(arm: tuple[str, int]) -> None:
    ip, version = arm
    for _ in range(3):
        peer = Peer(ip, version)
        assert peer.response(peer.move()) == b"\x01"
        peer.until_moving()
        peer.send(command())
        peer.close()
    end = time.monotonic() + PATIENCE
    while True:
        try:
            with Peer(ip, version) as peer:
                peer.state()
                assert peer.until_modes(1)
                return
        except OSError:
            assert time.monotonic() < end


def test_what_libfranka_sets_is_in_the_state_and_what_is_wrong_is_refused() -> None:
    with control_box(*FAST) as (ip, _):
        lines = run_client(SETTERS, ip).splitlines()
    m_load, stiffness, lowered = json.loads(lines[0])
    assert (m_load, stiffness) == (1.5, 0.2)
    assert lowered == pytest.approx(0.1, abs=1e-3)
    assert "Set Load" in lines[1] or "invalid" in lines[1]


def test_the_model_that_libfranka_loads_knows_the_torque_that_holds_the_arm() -> None:
    with control_box(*FAST) as (ip, _):
        gravity, torque = json.loads(run_client(MODEL, ip))
    assert gravity == pytest.approx(torque, abs=1e-6)


def test_a_plant_that_breaks_down_ends_the_motion_by_name_is_put_back_and_the_box_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    device = make_arm(ControlBoxCommand().parser().parse_args(["--no-collision"]), ROBOTS["panda"])
    try:
        start = device.state.q[:]
        assert device.move(MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.JOINT_VELOCITY)) is RequestOutcome.STARTED
        for _ in range(200):
            device.cycle(command(1.0))
        assert device.state.q != start
        step, device.plant.step = device.plant.step, break_down  # type: ignore[method-assign]
        device.cycle(command(1.0))
        device.plant.step = step  # type: ignore[method-assign]
        assert "diverged" in caplog.text and "reset to its start pose" in caplog.text
        assert device.take_finished() is RequestOutcome.REFLEX_ABORTED
        assert device.state.current_errors == device.state.last_motion_errors == {"instability_detected"}
        assert device.state.q == pytest.approx(start, abs=1e-12) and device.state.robot_mode is RobotMode.REFLEX
        for _ in range(100):
            device.cycle(None)
        assert device.state.q == pytest.approx(start, abs=1e-6)
        assert device.recover() is RequestOutcome.SUCCESS and device.state.robot_mode is RobotMode.IDLE
        assert device.move(MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.JOINT_VELOCITY)) is RequestOutcome.STARTED
    finally:
        device.close()


def test_a_plant_that_breaks_down_at_idle_is_put_back_without_an_error() -> None:
    device = make_arm(ControlBoxCommand().parser().parse_args(["--no-collision"]), ROBOTS["panda"])
    try:
        start = device.state.q[:]
        device.push("panda_link7", (0.0, 0.0, 1e7), 0.01)
        device.cycle(None)
        assert device.state.q == pytest.approx(start, abs=1e-6)
        assert device.state.robot_mode is RobotMode.IDLE and not device.state.current_errors
    finally:
        device.close()


def break_down() -> None:
    raise HricError("the simulation diverged")


def test_a_load_beyond_all_sense_is_refused() -> None:
    with control_box(*FAST) as (ip, process), Peer(ip) as peer:
        for load in ((1e200, 0.0), (1.0, 1e100)):
            assert peer.exchange(10, struct.pack("<13d", load[0], load[1], *[0.0] * 11)) == b"\x02"
        assert peer.exchange(10, struct.pack("<13d", 3.0, *[0.0] * 12)) == b"\x00"
        assert "exceeds the maximum of 20 kg" in log_of(process)


def trajectory(period: int) -> list[tuple[float, ...]]:
    """Measured positions of a motion in lock-step, from a server of its own."""
    with control_box(*FAST) as (ip, _), Peer(ip) as peer:
        assert peer.response(peer.move()) == b"\x01"
        peer.until_moving()
        peer.newest_state()
        rows = []
        for k in range(500):
            peer.send(command(0.02 * (k % period)))
            rows.append(struct.unpack_from("<7d", peer.state(), 1184))
        return rows


def test_lock_step_repeats_a_motion() -> None:
    # The arm holds itself before, for a time that varies, which leaves the rounding of another moment in its start.
    first, second, other = np.array(trajectory(20)), np.array(trajectory(20)), np.array(trajectory(21))
    assert np.abs(first - second).max() < 1e-11
    assert np.abs(first - other).max() > 1e-6
