"""The emulated controller with an unmodified ur_rtde, and with bytes that no client should send."""

import socket
import struct
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from ur_robot.connection import probe

rtde_control = pytest.importorskip("rtde_control", reason="scripts/setup --with ur")
rtde_receive = pytest.importorskip("rtde_receive", reason="scripts/setup --with ur")
dashboard_client = pytest.importorskip("dashboard_client", reason="scripts/setup --with ur")

pytestmark = pytest.mark.alone


def until(true: Callable[[], bool], timeout: float = 10.0) -> bool:
    """Wait until something is true; False if it is not in time."""
    deadline = time.monotonic() + timeout
    while not true():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


@pytest.fixture
def states(box) -> Iterator[object]:
    client = rtde_receive.RTDEReceiveInterface(box.ip)
    yield client
    client.disconnect()


@pytest.fixture
def control(box) -> Iterator[object]:
    client = rtde_control.RTDEControlInterface(box.ip)
    yield client
    client.disconnect()


def servo(control, q: list[float]) -> bool:
    return bool(control.servoJ(q, 0.0, 0.0, 0.002, 0.1, 300.0))


def test_all_variables_arrive_and_what_is_not_simulated_is_not_a_number(states) -> None:
    assert states.getSafetyMode() == 1 and states.getRobotMode() == 7
    assert np.isfinite(states.getActualQ()).all() and np.isnan(states.getJointTemperatures()).all()


def test_the_arm_follows_a_servo_target_and_stops(states, control) -> None:
    goal = [q + 0.1 for q in states.getActualQ()]
    assert servo(control, goal)
    assert until(lambda: np.abs(np.subtract(states.getActualQ(), goal)).max() < 1e-3)
    assert control.servoStop(2.0)
    assert until(lambda: np.abs(states.getActualQd()).max() < 1e-3)
    assert control.isProgramRunning()


def test_a_jump_beyond_the_speed_limit_is_a_protective_stop(box, states, control) -> None:
    start = states.getActualQ()
    assert servo(control, [start[0] + 1.5, *start[1:]])
    assert until(states.isProtectiveStopped) and states.getSafetyMode() == 3
    assert not servo(control, start)
    assert until(lambda: np.abs(states.getActualQd()).max() < 1e-3)
    # From 3.14 rad/s, the limit, with 10 rad/s^2.
    assert states.getActualQ()[0] - start[0] == pytest.approx(np.pi**2 / 20.0, rel=0.02)
    assert "protective stop: joint 1 at" in box.end()


def test_a_protective_stop_is_unlocked_after_five_seconds_only(box, states, control) -> None:
    dashboard = dashboard_client.DashboardClient(box.ip)
    dashboard.connect()
    assert not control.triggerProtectiveStop()
    assert until(states.isProtectiveStopped)
    stopped = states.getTimestamp()
    with pytest.raises(RuntimeError, match="until 5s after occurrence"):
        dashboard.unlockProtectiveStop()
    assert until(lambda: states.getTimestamp() > stopped + 5.1, 60.0)
    dashboard.unlockProtectiveStop()
    assert until(lambda: not states.isProtectiveStopped())
    control.reuploadScript()
    assert until(control.isProgramRunning)
    dashboard.disconnect()


def test_the_watchdog_ends_the_program_of_a_silent_client(box, states, control) -> None:
    assert servo(control, [q + 0.3 for q in states.getActualQ()])
    assert control.setWatchdog(10.0)
    assert until(lambda: states.getRuntimeState() == 1)
    assert "watchdog, no command for 0.1 s" in box.end()


def test_a_motion_that_is_not_emulated_ends_the_program(box, states, control) -> None:
    assert not control.moveJ(states.getActualQ())
    assert "command 1 of ur_rtde is not emulated; valid: 0, 11, 16" in box.end()


def test_a_second_client_cannot_write_the_same_registers(box, control) -> None:
    with pytest.raises(RuntimeError, match="already in use"):
        rtde_control.RTDEControlInterface(box.ip)
    assert control.isProgramRunning()


BAD = {
    "short": (30004, struct.pack(">HB", 2, ord("V")), "a package of 2 bytes; valid: 3 to 4096"),
    "long": (30004, struct.pack(">HB", 60000, ord("O")), "a package of 60000 bytes"),
    "unknown": (30004, struct.pack(">HB", 3, 1), "a package of type 1"),
    "version": (30004, struct.pack(">HB", 3, ord("V")), "a protocol version of 0 bytes; valid: 2"),
    "rate": (30004, struct.pack(">HBd", 11, ord("O"), float("nan")), "an output rate of nan Hz"),
    "inputs": (30004, struct.pack(">HBB", 4, ord("U"), 1), "inputs of recipe 1, but has set up 0 recipes"),
    "values": (
        30004,
        struct.pack(">HB20s", 23, ord("I"), b"input_int_register_7") + struct.pack(">HBBB", 5, ord("U"), 1, 0),
        "inputs of 1 bytes; valid: 4",
    ),
    "script": (30003, b"movej([0,0,0,0,0,0])\n", "no other URScript is emulated"),
    "line": (29999, b"x" * 2000, "a line of more than 1024 bytes"),
}


def test_bad_bytes_cost_their_sender_only(box, states) -> None:
    for port, data, _ in BAD.values():
        with socket.create_connection((box.ip, port), 5.0) as connection:
            connection.sendall(data)
            while connection.recv(4096):
                pass
    stamp = states.getTimestamp()
    assert until(lambda: states.getTimestamp() > stamp)
    log = box.end()
    assert log.count("disconnected") == len(BAD)
    assert all(text in log for _, _, text in BAD.values()), log


def test_a_client_that_does_not_read_misses_states_and_delays_nobody(box, states) -> None:
    names = b"actual_q,actual_qd,target_q"
    with socket.create_connection((box.ip, 30004), 5.0) as silent:
        silent.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        silent.sendall(struct.pack(">HBd", 11 + len(names), ord("O"), 500.0) + names + struct.pack(">HB", 3, ord("S")))
        stamp = states.getTimestamp()
        assert until(lambda: states.getTimestamp() > stamp + 2.0, 30.0)
        probe(box.ip, 5.0)
