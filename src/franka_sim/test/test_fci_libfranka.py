"""The unmodified clients, panda-python (libfranka 0.9.2) and pylibfranka (0.21), to a server without an arm: states,
errors, control loop, hand."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fci_peer import control_box, new_address, run_client, serving, wait_until_up
from test_fci_wire import OFFSETS, patterned

from franka_sim.fci.device import ConstantDevice
from franka_sim.fci.robots import fr3_served_urdf
from franka_sim.fci.wire import WIRE_ERRORS
from franka_sim.gripper import Gripper

VERSIONS = pytest.mark.parametrize("version", [5, 10])
CONNECT = """
import json, sys, time
if sys.argv[2] == "5":
    from panda_py import libfranka as franka
else:
    import pylibfranka as franka
robot = franka.Robot(sys.argv[1], franka.RealtimeConfig.kIgnore)
"""
READ = (
    CONNECT
    + """
state = robot.read_once()
fields = {name: getattr(state, name) for name in json.loads(sys.argv[3]) if hasattr(state, name)}
seen = []
def names(errors):
    return repr(errors) + " ".join(name for name in dir(errors) if getattr(errors, name) is True)
for _ in range(400):
    state = robot.read_once()
    seen.append((1000.0 * state.time.to_sec(), names(state.current_errors), names(state.last_motion_errors)))
print(json.dumps([fields, seen]))
"""
)
TORQUE = {
    5: CONNECT
    + """
count, rates = 0, []
def callback(state, period):
    global count
    count += 1
    rates.append(state.control_command_success_rate)
    torques = franka.Torques([0.0] * 7)
    return franka.motion_finished(torques) if count == 2000 else torques
for _ in range(2):
    count = 0
    robot.control(callback)
    assert "kIdle" in str(robot.read_once().robot_mode), robot.read_once().robot_mode
print(json.dumps([count, min(rates)]))
""",
    10: CONNECT
    + """
for _ in range(2):
    control, rates = robot.start_torque_control(), []
    for count in range(1, 2001):
        state, period = control.readOnce()
        rates.append(state.control_command_success_rate)
        torques = franka.Torques([0.0] * 7)
        torques.motion_finished = count == 2000
        control.writeOnce(torques)
    del control
    assert "Idle" in str(robot.read_once().robot_mode), robot.read_once().robot_mode
print(json.dumps([count, min(rates)]))
""",
}
STAYS = CONNECT + 'print("connected", flush=True); time.sleep(60)'
APPENDED = "rates.append(state.control_command_success_rate)"
RUNS = '; len(rates) == 100 and print("runs", flush=True)'
THROW = {
    5: CONNECT
    + """
def callback(state, period):
    raise ValueError("the user's own")
for _ in range(3):
    try:
        robot.control(callback)
    except ValueError as error:
        print(error)
""",
    10: CONNECT
    + """
for _ in range(3):
    control = robot.start_torque_control()
    control.readOnce()
    del control
    print("the user's own")
""",
}
HAND = """
import sys
if sys.argv[2] == "5":
    from panda_py.libfranka import Gripper
else:
    from pylibfranka import Gripper
hand = Gripper(sys.argv[1])
print(hand.homing(), hand.move(0.05, 0.1), round(hand.read_once().width, 6), hand.grasp(0.02, 0.1, 20.0, 0.005, 0.005), hand.read_once().is_grasped)
print(hand.grasp(0.03, 0.1, 20.0, 0.005, 0.005), hand.read_once().is_grasped, hand.stop(), round(hand.read_once().max_width, 3))
try:
    print(hand.move(0.5, 0.1))
except Exception as error:
    print(type(error).__name__)
"""  # noqa: E501


@contextmanager
def pattern(version: int) -> Iterator[str]:
    """A server whose state is a pattern, in a process of its own."""
    ip = new_address()
    process = subprocess.Popen([sys.executable, str(Path(__file__).parent / "fci_pattern.py"), ip, str(version)])
    try:
        wait_until_up(ip, process)
        yield ip
    finally:
        process.kill()
        process.communicate()


@VERSIONS
def test_libfranka_reads_each_number_of_the_state_and_each_of_the_41_errors(version: int) -> None:
    with pattern(version) as ip:
        fields, seen = json.loads(run_client(READ, ip, str(version), json.dumps(list(OFFSETS))))
    state = patterned()
    assert fields == {name: getattr(state, name) for name in fields} and len(fields) >= 34
    errors = set()
    for milliseconds, current, last in seen:
        name = WIRE_ERRORS[round(milliseconds) % 41]
        assert name in current.lower() and name in last.lower(), f"{name} is not in {current}"
        errors.add(name)
    assert errors == set(WIRE_ERRORS)


@VERSIONS
def test_a_torque_loop_of_libfranka_loses_no_packet_in_lock_step(version: int) -> None:
    with control_box("--constant", "--robot", "panda" if version == 5 else "fr3", "--real-time-factor", "0") as (ip, _):
        assert json.loads(run_client(TORQUE[version], ip, str(version))) == [2000, 1.0]


@VERSIONS
def test_a_callback_that_raises_stops_the_motion_and_the_next_one_begins(version: int) -> None:
    with control_box("--constant", "--robot", "panda" if version == 5 else "fr3") as (ip, _):
        assert run_client(THROW[version], ip, str(version)).splitlines() == ["the user's own"] * 3


def test_libfranka_names_the_versions_when_they_differ() -> None:
    with serving(ConstantDevice(), 10) as ip, pytest.raises(AssertionError, match=r"[Ii]ncompatible"):
        run_client(CONNECT, ip, "5")


def test_libfranka_says_that_a_second_client_is_turned_away() -> None:
    with (
        control_box("--constant") as (ip, _),
        subprocess.Popen([sys.executable, "-c", STAYS, ip, "5"], stdout=subprocess.PIPE, text=True) as first,
    ):
        try:
            assert first.stdout is not None and first.stdout.readline() == "connected\n"
            with pytest.raises(AssertionError, match=r"TCP|connection"):
                run_client(CONNECT, ip, "5", limit=20.0)
        finally:
            first.kill()


@VERSIONS
def test_a_server_that_is_killed_ends_the_control_loop_of_the_client(version: int) -> None:
    script = TORQUE[version].replace("2000", "200000000").replace(APPENDED, APPENDED + RUNS)
    with control_box("--constant", "--robot", "panda" if version == 5 else "fr3") as (ip, process):
        client = subprocess.Popen(
            [sys.executable, "-c", script, ip, str(version)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            assert client.stdout is not None and client.stdout.readline() == "runs\n"
            process.kill()
            _, text = client.communicate(timeout=30.0)
        finally:
            client.kill()
    assert client.returncode != 0 and ("UDP" in text or "TCP" in text or "connection" in text.lower()), text


@VERSIONS
def test_the_hand_homes_moves_grasps_misses_and_stops(version: int) -> None:
    hand = Gripper()
    hand.object_width = 0.03
    with serving(ConstantDevice(fr3_served_urdf(), hand), version, pace=10.0) as ip:
        printed = run_client(HAND, ip, str(version)).splitlines()
    assert printed[0].split()[3:] == ["False", "False"], "the object is 3 cm wide"
    assert printed[1].split() == ["True", "True", "True", "0.08"]
    assert printed[2] == "CommandException" or printed[2] == "RuntimeError"
