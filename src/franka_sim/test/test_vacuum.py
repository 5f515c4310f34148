"""The vacuum gripper: pump, cup and held body in the plant, and libfranka's client at its port."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fci_peer import CONTROL_BOX, command, control_box, log_of, run_client

from franka_hw_interface.hand import HandMotion, HandOutcome
from franka_hw_interface.model import FrankaFrame
from franka_sim.box.requests import ControllerMode, GeneratorMode, MoveRequest, RequestOutcome
from franka_sim.fci.app import ControlBoxCommand
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.robots import ROBOTS
from franka_sim.fci.world_building import make_arm
from franka_sim.vacuum import VacuumGripper, defaults

pytestmark = pytest.mark.alone

ENGINE = "pybullet_ros_control/PyBulletPlant"
ENGINES = pytest.mark.parametrize("engine", [ENGINE, "mujoco_ros_control/MujocoPlant"])
MASS = 0.5
WORLD = f"""
objects:
  - {{name: stand, shape: box, size: [0.2, 0.2, 0.42], pose: {{xyz: [0.307, 0.0, 0.21]}}}}
  - {{name: block, shape: box, size: [0.08, 0.08, 0.06], mass: {MASS}, pose: {{xyz: [0.307, 0.0, 0.45]}}}}
"""
"""The block's top is 5 mm below the cup at the start pose."""
Q_START = ["0", "-0.7853981633974483", "0", "-2.356194490192345", "0", "1.5707963267948966", "0.7853981633974483"]


@pytest.fixture
def world(tmp_path: Path) -> str:
    (tmp_path / "world.yaml").write_text(WORLD)
    return str(tmp_path / "world.yaml")


@pytest.fixture
def make(world: str) -> Iterator[Callable[[str], ArmDevice]]:
    arms: list[ArmDevice] = []

    def build(engine: str) -> ArmDevice:
        words = ["--vacuum", "--world", world, "--plant", engine, "--no-reflexes", "--q-start", *Q_START]
        arms.append(make_arm(ControlBoxCommand().parser().parse_args(words), ROBOTS["panda"]))
        return arms[-1]

    yield build
    for arm in arms:
        arm.close()


def pump(arm: ArmDevice) -> VacuumGripper:
    assert isinstance(arm.hand, VacuumGripper)
    return arm.hand


def run(arm: ArmDevice, motion: HandMotion | None = None, seconds: float = 2.0) -> None:
    """Run until the request has ended, or for the time."""
    for cycle in range(round(seconds * 1000)):
        if motion is not None and motion.outcome is not None:
            return
        arm.cycle(None)
        if cycle % 10 == 9:
            pump(arm).step(0.01)


def move(arm: ArmDevice, down: float) -> None:
    """Move the cup down by a distance [m] and wait until it rests there."""
    q = np.array(arm.state.q_d)
    for _ in range(20):
        J = arm.box.model.zero_jacobian(FrankaFrame.FLANGE, q)
        q += np.linalg.pinv(J) @ [0.0, 0.0, -down / 20, 0.0, 0.0, 0.0]
    request = MoveRequest(ControllerMode.JOINT_IMPEDANCE, GeneratorMode.JOINT_POSITION, maximum_velocity=(0.2,) * 7)
    assert arm.move(request) is RequestOutcome.STARTED
    arm.cycle(command(q=q.tolist()))
    run(arm, seconds=1.0)
    arm.cycle(command(finished=True))
    assert arm.state.idle


def height(arm: ArmDevice) -> float:
    return float(arm.plant.link_state("block::link")[0][2, 3])


@ENGINES
def test_it_lifts_the_block_that_it_touches_and_lets_it_go(make: Callable[[str], ArmDevice], engine: str) -> None:
    arm = make(engine)
    run(arm, seconds=0.2)
    before = height(arm)
    move(arm, 0.006)
    motion = pump(arm).suck(600.0, 1.0)
    run(arm, motion)
    assert motion.outcome is HandOutcome.SUCCESS and pump(arm).in_control_range
    run(arm, seconds=0.5)
    assert pump(arm).part_present and pump(arm).vacuum == 600.0 and pump(arm).power == 0
    move(arm, -0.05)
    assert height(arm) - before == pytest.approx(0.05, abs=0.003)
    run(arm, seconds=1.0)
    assert arm.state.O_F_ext_hat_K[2] == pytest.approx(9.81 * MASS, abs=0.2), "the arm carries the block"
    motion = pump(arm).drop_off(1.0)
    run(arm, motion)
    assert motion.outcome is HandOutcome.SUCCESS and pump(arm).part_detached and not pump(arm).part_present
    run(arm, seconds=1.0)
    assert height(arm) == pytest.approx(before, abs=0.002), "back on the stand"


def test_without_a_body_within_reach_the_suction_times_out_and_the_pump_is_off(make: Callable) -> None:
    arm = make(ENGINE)
    motion = pump(arm).suck(600.0, 0.5)
    run(arm, motion)
    assert motion.outcome is HandOutcome.UNSUCCESSFUL and "0 mbar at the time-out" in motion.reason
    assert (pump(arm).vacuum, pump(arm).power, pump(arm).part_present) == (0.0, 0, False)
    assert arm.plant.connections() == []


def test_a_pull_beyond_vacuum_times_area_loses_the_block(make: Callable[[str], ArmDevice]) -> None:
    arm = make(ENGINE)
    move(arm, 0.006)
    run(arm, pump(arm).suck(600.0, 1.0))
    move(arm, -0.05)
    hold = 600.0 * 100.0 * np.pi * defaults().cup_diameter ** 2 / 4.0
    for share, held in ((0.5, True), (1.5, False)):
        arm.plant.apply_wrench("block::link", [0.0, 0.0, MASS * 9.81 - share * hold], [0.0] * 3, [0.0] * 3, 0.5)
        run(arm, seconds=0.5)
        assert pump(arm).part_present is held, share
    assert arm.plant.connections() == [] and pump(arm).part_detached


def test_a_held_block_stays_while_the_setpoint_rises_and_is_then_held_more_firmly(make: Callable) -> None:
    arm = make(ENGINE)
    move(arm, 0.006)
    run(arm, pump(arm).suck(200.0, 1.0))
    move(arm, -0.05)
    assert not pump(arm).part_present, "the vacuum is below that of a part"
    motion = pump(arm).suck(700.0, 1.0)
    while motion.outcome is None:
        run(arm, seconds=0.01)
        assert arm.plant.connections()
    arm.plant.apply_wrench("block::link", [0.0, 0.0, -40.0], [0.0] * 3, [0.0] * 3, 0.5)  # 200 mbar hold 25 N
    run(arm, seconds=0.5)
    assert pump(arm).part_present and arm.plant.connections()


def test_a_new_request_aborts_the_one_before_and_stop_switches_the_pump_off(make: Callable[[str], ArmDevice]) -> None:
    arm = make(ENGINE)
    first = pump(arm).suck(600.0, 1.0)
    second = pump(arm).drop_off(1.0)
    assert first.outcome is HandOutcome.ABORTED and second.outcome is None
    third = pump(arm).suck(600.0, 1.0)
    assert pump(arm).power == 100
    assert pump(arm).stop().outcome is HandOutcome.SUCCESS
    assert third.outcome is HandOutcome.ABORTED and pump(arm).power == 0


def test_a_setpoint_beyond_the_pump_is_lowered_and_one_of_zero_refused(make: Callable[[str], ArmDevice]) -> None:
    arm = make(ENGINE)
    move(arm, 0.006)
    motion = pump(arm).suck(1000.0, 1.0)
    run(arm, motion)
    run(arm, seconds=1.0)
    assert motion.outcome is HandOutcome.SUCCESS and pump(arm).vacuum == 750.0
    assert pump(arm).suck(0.0, 1.0).outcome is HandOutcome.FAIL
    assert pump(arm).suck(600.0, 1.0, profile=4).outcome is HandOutcome.FAIL
    assert pump(arm).drop_off(-1.0).outcome is HandOutcome.FAIL
    assert pump(arm).in_control_range, "a refused request changes nothing"


def test_the_box_knows_the_mass_of_the_pump_and_holds_it(make: Callable[[str], ArmDevice]) -> None:
    arm = make(ENGINE)
    run(arm, seconds=0.5)
    assert arm.state.m_ee == defaults().mass and arm.state.q == pytest.approx(arm.state.q_d, abs=1e-6)


CLIENT = """
import datetime, json, sys
from panda_py import libfranka as franka
gripper, limit = franka.VacuumGripper(sys.argv[1]), datetime.timedelta(seconds=float(sys.argv[2]))
def state():
    state = gripper.read_once()
    return [state.part_present, state.in_control_range, state.part_detached, state.vacuum, str(state.device_status)]
result = [gripper.server_version(), state(), gripper.vacuum(60, limit), state(), gripper.drop_off(limit), state()]
print(json.dumps(result))
try:
    gripper.vacuum(0, limit)
except RuntimeError as error:
    print(error)
"""
GREEN = "VacuumGripperDeviceStatus.kGreen"


@pytest.mark.parametrize("robot", ["panda", "fr3"])
def test_libfranka_hears_that_nothing_is_within_reach(robot: str, world: str) -> None:
    with control_box("--robot", robot, "--vacuum", "--world", world) as (ip, process):
        result, refused = run_client(CLIENT, ip, "0.3").splitlines()
        log = log_of(process)
    off = [False, False, False, 0, GREEN]
    assert json.loads(result) == [1, off, False, off, True, off]
    assert "ommand failed" in refused and "setpoint 0 mbar" in log


def test_libfranka_holds_a_part_that_the_pump_touches_and_drops_it(tmp_path: Path) -> None:
    higher = WORLD.replace("0.42]", "0.4256]").replace("0.21]", "0.2128]").replace("0.45]", "0.4556]")
    (tmp_path / "world.yaml").write_text(higher)
    with control_box("--no-reflexes", "--vacuum", "--world", str(tmp_path / "world.yaml")) as (ip, _):
        result, _ = run_client(CLIENT, ip, "5").splitlines()
    _, before, held, during, dropped, after = json.loads(result)
    assert before[:3] == [False, False, False] and held and during[:2] == [True, True] and during[3] == 600
    assert dropped and after[:3] == [False, False, True]


def test_a_vacuum_gripper_without_physics_is_refused() -> None:
    done = subprocess.run(
        [sys.executable, str(CONTROL_BOX), "--constant", "--vacuum"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2 and "--vacuum needs physics" in done.stderr
