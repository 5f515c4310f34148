"""Asynchronous joint positions of protocol 10: pylibfranka's handler, and what no client of libfranka sends."""

import json
import struct

import pytest
from fci_peer import Peer, command, control_box, log_of, run_client, wait_for_log

pytestmark = pytest.mark.alone

STARTED, SUCCESS, INVALID_ARGUMENT, REFLEX_ABORTED = 1, 0, 7, 8
READY = [0.0, -0.7853981633974483, 0.0, -2.356194490192345, 0.0, 1.5707963267948966, 0.7853981633974483]
HANDLER = """
import json, sys, time
import pylibfranka as franka
robot = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)
Handler = franka.AsyncPositionControlHandler
start = list(robot.read_once().q)
def configure(velocity):
    configuration = Handler.Configuration(maximum_joint_velocities=[velocity] * 7, goal_tolerance=0.001)
    return Handler.configure(robot, configuration)
def follow(handler, target, seen):
    handler.set_joint_position_target(Handler.JointPositionTarget(target))
    end = time.monotonic() + 20.0
    while time.monotonic() < end and seen[-1:] != ["TargetStatus.kTargetReached"]:
        feedback = handler.get_target_feedback()
        assert feedback.error_message is None, feedback.error_message
        seen.append(str(feedback.status))
        time.sleep(0.02)
"""
TARGETS = (
    HANDLER
    + """
handler, statuses = configure(0.5).handler, []
statuses.append(str(handler.get_target_feedback().status))
for step in (0.3, -0.1):
    seen = []
    follow(handler, [*start[:3], start[3] + step, *start[4:6], start[6] - step], seen)
    statuses.append(sorted(set(seen)))
handler.stop_control()
for _ in range(300):
    state = robot.read_once()
print(json.dumps([statuses, state.q[3] - start[3], state.q[6] - start[6], str(state.robot_mode)]))
"""
)
BRAKES = (
    HANDLER
    + """
handler = configure(0.5).handler
handler.set_joint_position_target(Handler.JointPositionTarget([start[0] + 1.0, *start[1:]]))
while abs(robot.read_once().dq_d[0]) < 0.4:
    pass
handler.stop_control()
state = robot.read_once()
errors = [name for name in dir(state.current_errors) if getattr(state.current_errors, name) is True]
print(json.dumps([state.q_d[0] - start[0], state.dq_d[0], str(state.robot_mode), errors]))
handler = configure(0.5).handler
handler.set_joint_position_target(Handler.JointPositionTarget([9.0, *start[1:]]))
time.sleep(0.2)
feedback = handler.get_target_feedback()
print(feedback.status, feedback.error_message)
del handler
robot.automatic_error_recovery()
print(configure(0.0).error_message)
"""
)


def test_pylibfranka_sends_targets_and_hears_when_they_are_reached() -> None:
    with control_box("--robot", "fr3", "--no-collision") as (ip, _):
        statuses, knee, wrist, mode = json.loads(run_client(TARGETS, ip))
    both = ["TargetStatus.kExecuting", "TargetStatus.kTargetReached"]
    assert statuses == ["TargetStatus.kIdle", both, both]
    assert (knee, wrist) == (pytest.approx(-0.1, abs=1e-4), pytest.approx(0.1, abs=1e-4))
    assert mode == "RobotMode.Idle"


def test_pylibfranka_stops_the_arm_on_its_way_and_hears_why_a_target_is_refused() -> None:
    with control_box("--robot", "fr3", "--no-collision") as (ip, process):
        braked, refused, *_, invalid = run_client(BRAKES, ip).splitlines()
        log = log_of(process)
    moved, speed, mode, errors = json.loads(braked)
    assert 0.0 < moved < 1.0 and (speed, mode, errors) == (0.0, "RobotMode.Idle", [])
    assert "TargetStatus.kAborted" in refused and "joint_motion_generator_position_limits_violation" in refused
    assert "fr3_joint1 at 9 rad" in log
    assert "command rejected" in invalid and "maximum velocities" in log


def move(peer: Peer, velocity: float, generator: int = 0) -> int:
    payload = struct.pack("<II6d", 0, generator, 10.0, 3.12, 6.28, 10.0, 3.12, 6.28)
    return peer.request(1, payload + struct.pack("<B7d", 1, *[velocity] * 7))


def q_d(state: bytes) -> float:
    """Return the desired position of the first joint."""
    return float(struct.unpack_from("<f", state, 624)[0])


def success_rate(state: bytes) -> float:
    """Return the share of the last cycles that had a command, 0 to 1."""
    return float(struct.unpack_from("<f", state, 1373)[0])


def test_no_command_is_late_but_one_older_than_the_last_is_dropped() -> None:
    with control_box("--robot", "fr3", "--no-collision") as (ip, _), Peer(ip, 10) as peer:
        for _ in range(100):
            peer.state()
        first = peer.message_id
        request = move(peer, 1.0)
        assert peer.response(request) == bytes([STARTED])
        for _ in range(200):
            peer.state()
        peer.send(command(q=[0.1, *READY[1:]]))
        for _ in range(50):
            peer.state()
        peer.send(command(q=[-0.5, *READY[1:]]), first)
        for _ in range(1000):
            state = peer.state()
        assert peer.modes(state) == (1, 0, 2)
        assert q_d(state) == pytest.approx(0.1, abs=1e-6)
        peer.finish()
        assert peer.response(request) == bytes([SUCCESS])


def test_the_arm_goes_on_to_its_target_while_the_client_sends_nothing() -> None:
    with control_box("--robot", "fr3", "--no-collision", "--clock", "wall") as (ip, _), Peer(ip, 10) as peer:
        request = move(peer, 1.0)
        assert peer.response(request) == bytes([STARTED])
        assert success_rate(peer.state()) == 0.0
        peer.send(command(q=[0.2, *READY[1:]]))
        states = [peer.state() for _ in range(1500)]
        assert q_d(states[-1]) == pytest.approx(0.2, abs=1e-6)
        assert {success_rate(state) for state in states} <= {0.0, 1.0} and success_rate(states[-1]) == 1.0


@pytest.mark.parametrize(("velocity", "generator"), [(0.0, 0), (-1.0, 0), (1.0, 1)])
def test_a_maximum_velocity_or_generator_that_cannot_be_is_an_invalid_argument(velocity: float, generator: int) -> None:
    with control_box("--robot", "fr3", "--no-collision") as (ip, process), Peer(ip, 10) as peer:
        assert peer.response(move(peer, velocity, generator)) == bytes([INVALID_ARGUMENT])
        wait_for_log(process, "move refused: ")
