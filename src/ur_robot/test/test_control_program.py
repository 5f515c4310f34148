"""Servo motion and limits of the emulated controller, and its server in one process."""

import math
import socket
import struct

import pytest
from fci_peer import new_address

from ur_robot.emulated.control_program import PERIOD, Runtime, UrController
from ur_robot.emulated.server import UrServer

LIMITS = [(-math.pi, math.pi, math.pi)] * 6


def controller(q: list[float] | None = None) -> UrController:
    made = UrController(q or [0.0] * 6, LIMITS)
    made.start_program(0)
    return made


def command(made: UrController, number: int, *values: float) -> None:
    registers = {f"input_double_register_{i}": value for i, value in enumerate(values)}
    made.write({"input_int_register_0": number, **registers})


def servo(made: UrController, q: float, lookahead: float = 0.1) -> None:
    command(made, 11, *[q] * 6, 0.0, 0.0, 0.002, lookahead, 300.0)


def test_a_goal_of_constant_speed_is_followed_with_the_lookahead_time() -> None:
    made, speed = controller(), 0.5
    for cycle in range(1000):
        servo(made, speed * cycle * PERIOD)
        made.cycle()
    assert speed * 999 * PERIOD - made.servo.q[0] == pytest.approx(speed * 0.1, rel=0.02)


@pytest.mark.parametrize("values", [(math.nan, 0.1), (0.1, 0.5), (0.1, math.nan)])
def test_a_servo_command_that_is_not_valid_ends_the_program(values: tuple[float, float]) -> None:
    made = controller()
    servo(made, *values)
    made.cycle()
    assert made.runtime is Runtime.STOPPED and made.servo.q == [0.0] * 6


def test_leaving_the_range_is_a_protective_stop_from_which_the_arm_can_return() -> None:
    made = controller([3.1] * 6)
    servo(made, 3.3)
    while not made.stop_reason:
        made.cycle()
    assert "limits -3.142 to 3.142" in made.stop_reason
    for _ in range(3000):
        made.cycle()
    assert made.unlock()
    made.start_program(0)
    servo(made, 3.0)
    for _ in range(1000):
        made.cycle()
    assert made.servo.q == pytest.approx([3.0] * 6, abs=1e-3) and not made.stop_reason


def test_registers_of_the_upper_range() -> None:
    made = UrController([0.0] * 6, LIMITS)
    made.start_program(24)
    values = {f"input_double_register_{24 + i}": value for i, value in enumerate([*[0.1] * 6, 0, 0, 0.002, 0.1, 300])}
    made.write({"input_int_register_24": 11, **values})
    made.cycle()
    assert made.servo.goal == [0.1] * 6 and made.state([], [], [])["output_int_register_24"] == 1


def test_a_client_that_floods_the_controller_delays_itself() -> None:
    written: list[dict[str, float]] = []
    made = controller()
    made.write = written.append  # type: ignore[method-assign]
    server = UrServer(made, new_address())
    try:
        with socket.create_connection(server._listeners[0].getsockname(), 5.0) as client:
            client.sendall(struct.pack(">HB20s", 23, ord("I"), b"input_int_register_7"))
            client.sendall(struct.pack(">HBBi", 8, ord("U"), 1, 5) * 2500)
            largest = 0
            while len(written) < 2500:
                before = len(written)
                server.poll({})
                largest = max(largest, len(written) - before)
    finally:
        server.close()
    assert largest <= 150
