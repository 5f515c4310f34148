"""Several emulated arms in one world: one step for all, and clients that keep none of them waiting."""

import os
import struct
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import pytest
from fci_peer import Peer, command, new_address, running

import panda_description
from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome
from franka_sim.fci.arm_input import read_arm
from franka_sim.fci.arm_world import ArmWorld
from franka_sim.fci.clock import SILENT, LockStepClock, MotionPhase
from franka_sim.fci.console import Console
from franka_sim.fci.server import FciServer
from franka_sim.fci.world_building import build_world, served_arms
from hric_core.errors import HricError
from hric_core.local.node import LocalNode

PLANT = {"collision": False, "self_collision": False}
PLACES = {"left": "0 0.5 0", "right": "0 -0.5 0"}
VELOCITY = MoveRequest(ControllerMode.JOINT_IMPEDANCE, GeneratorMode.JOINT_VELOCITY)


@pytest.fixture
def make_world() -> Iterator[Callable[..., tuple[ArmWorld, Mapping[str, Any]]]]:
    """make_world(name, ..., reflexes=False, ...) -> world of these arms, and what the server needs of them."""
    made: list[ArmWorld] = []

    def make(*names: str, **parameters: Any) -> tuple[ArmWorld, Mapping[str, Any]]:
        tree: dict[str, Any] = {}
        for name in names:
            text = panda_description.load(arm_id=name, xyz=PLACES[name], meshes=False, collision=False)
            robot = {"arm_id": name, "ip": new_address(), "plant": PLANT, **parameters}
            tree[name] = {"robot_description": text, "robot": robot}
        node = LocalNode(tree)
        inputs = {name: read_arm(node.child(f"{name}/robot")) for name in names}
        made.append(build_world(inputs, node))
        return made[-1], served_arms(inputs, made[-1])

    yield make
    for world in made:
        world.close()


def test_an_arm_moves_in_a_world_with_another_as_it_moves_alone(make_world: Any) -> None:
    together, alone = make_world("left", "right")[0], make_world("left")[0]
    for world in (together, alone):
        assert world.arms[0].move(VELOCITY) is RequestOutcome.STARTED
    difference = moved = 0.0
    for k in range(600):
        speed = command(dq=[1e-3 * min(k, 300)] * 7)
        together.cycle([speed, None])
        alone.cycle([speed])
        pairs = zip(together.arms[0].state.q, alone.arms[0].state.q, strict=True)
        difference = max(difference, *(abs(a - b) for a, b in pairs))
        moved = max(moved, abs(alone.arms[0].state.dq[0]))
    assert moved > 0.25 and difference < 1e-9
    right = together.arms[1].state
    assert right.q == pytest.approx(right.q_d, abs=1e-6), "the other arm has held its position"


def test_a_plant_that_breaks_down_puts_all_arms_back_and_only_a_motion_ends_in_a_reflex(make_world: Any) -> None:
    world, _ = make_world("left", "right")
    left, right = world.arms
    start = left.state.q[:], right.state.q[:]
    assert left.move(VELOCITY) is RequestOutcome.STARTED
    for k in range(300):
        world.cycle([command(dq=[1e-3 * k] * 7), None])
    assert left.state.q != pytest.approx(start[0], abs=1e-2)
    step, world.plant.step = world.plant.step, break_down
    world.cycle([command(dq=[0.3] * 7), None])
    world.plant.step = step
    world.cycle([None, None])
    assert left.state.q == pytest.approx(start[0], abs=1e-6) and right.state.q == pytest.approx(start[1], abs=1e-6)
    assert left.take_finished() is RequestOutcome.REFLEX_ABORTED and left.state.current_errors == {
        "instability_detected"
    }
    assert right.state.robot_mode is RobotMode.IDLE and not right.state.current_errors


def break_down() -> None:
    raise HricError("the simulation diverged")


@contextmanager
def serving(arms: Mapping[str, Any]) -> Iterator[None]:
    with running(FciServer(list(arms.values()), pace=0.0)):
        yield


@pytest.mark.parametrize("begun", [False, True])
def test_a_client_that_sends_nothing_does_not_keep_the_other_arm_waiting(make_world: Any, begun: bool) -> None:
    _, arms = make_world("left", "right", reflexes=False)  # so that lost commands end no motion
    with serving(arms), Peer(arms["left"].ip) as silent, Peer(arms["right"].ip) as mover:
        begin = time.monotonic()
        assert silent.response(silent.move()) == b"\x01"
        if begun:
            silent.until_moving()
            silent.send(command())
        assert mover.response(mover.move()) == b"\x01"
        mover.until_moving()
        mover.newest_state()
        at = []
        for _ in range(SILENT + 200):
            mover.send(command())
            state = mover.state()
            at.append(time.monotonic())
        assert at[-1] - at[SILENT] < at[SILENT] - begin, "200 cycles take less time than those that waited"
        assert mover.modes(state)[2] == RobotMode.MOVE.value
        assert struct.unpack("<d", state[-8:])[0] == 1.0, "each command of the other arm has arrived"


def test_a_clock_with_others_stops_waiting_for_a_client_that_is_silent() -> None:
    for phase in (MotionPhase.STARTING, MotionPhase.AWAITING):
        alone, shared = LockStepClock(0.0), LockStepClock(0.0, alone=False)
        for k in range(SILENT):
            assert (shared.left(5.0 + k, phase) > 2e-3) is (alone.left(5.0 + k, phase) > 2e-3)
            alone.ticked(5.0 + k, phase)
            shared.ticked(5.0 + k, phase)
        now = 5.0 + SILENT - 1.0
        assert alone.left(now, phase) >= 0.05 and shared.left(now, phase) == pytest.approx(1e-3)
        shared.ticked(now, MotionPhase.ARRIVED)
        assert shared.left(now, MotionPhase.AWAITING) == pytest.approx(0.5), "a client that is back is waited for"


def test_the_console_acts_on_the_arm_that_a_command_names(make_world: Any, caplog: pytest.LogCaptureFixture) -> None:
    world, arms = make_world("left", "right")
    world.cycle([None, None])
    receive, send = os.pipe()
    console = Console({name: arm.device for name, arm in arms.items()}, receive, lambda: None)
    for line, message in (
        ("right user_stop on", ""),
        ("middle user_stop on", "no arm 'middle'"),
        ("user_stop on", "no arm 'user_stop'"),
        ("left", "no console command ''"),
        ("left push left_link7 0 0 5 0.1", ""),
    ):
        os.write(send, line.encode() + b"\n")
        caplog.clear()
        console.on_input(1)
        assert message in caplog.text and bool(message) is ("ERROR" in caplog.text), caplog.text
    assert [arm.state.robot_mode for arm in world.arms] == [RobotMode.IDLE, RobotMode.USER_STOPPED]
    os.close(send)
    os.close(receive)
