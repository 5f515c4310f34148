"""Benchmark cases of the arm: a bare engine step, a plain Python loop, and the whole control cycle."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from std_msgs.msg import Float64MultiArray

import panda_description
from cases import Block
from hric_control.manager.controller_manager import ControllerManager
from hric_core import plugins
from hric_core.geometry import Pose, from_rotation_vector
from hric_core.local.node import LocalNode
from hric_core.processes import quiet_collector
from hric_core.urdf import read
from hric_human.body import Subject, describe
from hric_human.control import HumanControl
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_human.muscles.drive import MuscleDrive
from hric_human.muscles.muscle_set import MuscleSet

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
SETPOINT = [0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398]
GENERIC, FRANKA = "hric_control/RobotHWSim", "franka_sim/FrankaHWSim"
BLOCK = 400
"""Number of steps or cycles in a block."""
KP, KD = 50.0, 5.0


def arm_urdf() -> str:
    """Return the URDF of the Panda without collision shapes, with limits and transmissions."""
    return panda_description.load(hand=False, meshes=False, collision=False, robot_sim_type=GENERIC)


def timed(work: Callable[[int], object], units: int = BLOCK) -> Block:
    """Return a block that measures the processor time of a unit of work in this thread [s]."""

    def block() -> float:
        begin = time.thread_time()
        work(units)
        return (time.thread_time() - begin) / units

    return block


# -- the engine alone --------------------------------------------------------------------------------------------------


def _pybullet_arm() -> tuple[Any, int, int, list[int]]:
    """Return module, client, body and joints of the arm in PyBullet, loaded as in the plant with merged fixed links."""
    import pybullet

    from pybullet_ros_control.urdf_model import prepare

    client = pybullet.connect(pybullet.DIRECT)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(prepare(read(arm_urdf()), collision=False).xml, encoding="utf-8")
        body = pybullet.loadURDF(
            str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
        )
    pybullet.setTimeStep(1e-3, physicsClientId=client)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    count = pybullet.getNumJoints(body, client)
    joints = [i for i in range(count) if pybullet.getJointInfo(body, i, client)[2] != pybullet.JOINT_FIXED]
    for joint, q in zip(joints, SETPOINT, strict=True):
        pybullet.resetJointState(body, joint, q, physicsClientId=client)
        pybullet.setJointMotorControl2(body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client)
    return pybullet, client, body, joints


@contextmanager
def bare_pybullet() -> Iterator[Block]:
    """Measure PyBullet's stepSimulation."""
    pybullet, client, _, _ = _pybullet_arm()

    def run(n: int) -> None:
        for _ in range(n):
            pybullet.stepSimulation(client)

    yield timed(run)
    pybullet.disconnect(client)


def _mujoco_arm(integrator: str) -> tuple[Any, Any, Any]:
    """Return module, model and data of the arm, as MuJoCo reads its URDF."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(arm_urdf())
    model.opt.timestep, model.opt.integrator = 1e-3, getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = mujoco.MjData(model)
    data.qpos[:] = SETPOINT
    return mujoco, model, data


@contextmanager
def bare_mujoco(integrator: str) -> Iterator[Block]:
    """Measure MuJoCo's mj_step."""
    mujoco, model, data = _mujoco_arm(integrator)

    def run(n: int) -> None:
        for _ in range(n):
            mujoco.mj_step(model, data)

    yield timed(run)


# -- a plain loop: what one writes without a framework -----------------------------------------------------------------


@contextmanager
def plain_pybullet() -> Iterator[Block]:
    """Measure a loop with a PD law in numpy and setJointMotorControlArray on PyBullet."""
    pybullet, client, body, joints = _pybullet_arm()
    target = np.array(SETPOINT)

    def run(n: int) -> None:
        for _ in range(n):
            states = pybullet.getJointStates(body, joints, client)
            q, dq = np.array([state[0] for state in states]), np.array([state[1] for state in states])
            tau = KP * (target - q) - KD * dq
            pybullet.setJointMotorControlArray(
                body, joints, pybullet.TORQUE_CONTROL, forces=tau, physicsClientId=client
            )
            pybullet.stepSimulation(client)

    yield timed(run)
    pybullet.disconnect(client)


@contextmanager
def plain_mujoco() -> Iterator[Block]:
    """Measure a loop with a PD law in numpy and MuJoCo's bias forces, integrator implicitfast."""
    mujoco, model, data = _mujoco_arm("IMPLICITFAST")
    target = np.array(SETPOINT)

    def run(n: int) -> None:
        for _ in range(n):
            data.qfrc_applied[:] = KP * (target - data.qpos) - KD * data.qvel + data.qfrc_bias
            mujoco.mj_step(model, data)

    yield timed(run)


# -- the whole cycle ---------------------------------------------------------------------------------------------------


class WholeCycle:
    """Whole control cycle of a headless run: read, manager with PD law, limits with torque rate, write, physics.

    On RobotHWSim the controller adds gravity by KDL; on FrankaHWSim the emulated control box does so, with its checks.

    Args:
        robot_hw: plugin type of the RobotHW.
        simulator: pybullet, opensim or mujoco.
        plant: parameters of the plant.
        participants: participants that act in the plant.
    """

    def __init__(
        self, robot_hw: str, simulator: str, plant: dict[str, Any], participants: dict[str, Any] | None = None
    ) -> None:
        law = {
            "type": "hric_controllers/JointPDController",
            "joints": JOINTS,
            "kp": KP,
            "kd": KD,
            "gravity": robot_hw == GENERIC,
            "rotatum_limit": 1000.0,
            "profile": {"enabled": True},
            "state_publish_rate": 0,
        }
        robot = {
            "q_start": [*SETPOINT[:3], -2.0, *SETPOINT[4:]],
            "real_time_factor": 0.0,
            "plant_type": plugins.engines()[simulator].name,
            "plant": plant,
            "participants": participants or {},
        }
        limits = panda_description.joint_limit_parameters("panda")
        parts = {"robot_description": arm_urdf(), "joint_pd_controller": law, "robot": robot, "joint_limits": limits}
        node = LocalNode(parts)
        self.hw = plugins.find(plugins.ROBOT_HW, robot_hw)()
        self.hw.init(node, node.child("robot"))
        self.manager = ControllerManager(self.hw, node)
        self.manager.load("joint_pd_controller")
        self.manager.switch(["joint_pd_controller"], [], loop_running=False)
        self._left = 0
        self.run(2)  # the first cycle starts the controllers
        node.advertise("joint_pd_controller/command", Float64MultiArray).publish(Float64MultiArray(data=SETPOINT))

    def run(self, n: int) -> None:
        """Run n cycles of the robot's loop."""
        self._left = n
        self.hw.run(self._on_cycle)

    def _on_cycle(self, now: float, period: float, reset: bool) -> bool:
        self.manager.update(now, period, reset)
        self._left -= 1
        if self._left <= 0:
            self.hw.stop()
        return True


HELD = [0.42, 0.0, 0.55]
"""Position at which a human hand holds the robot [m]."""
REFERENCE = {"program": "sinusoid", "centre": HELD, "amplitude": [0.0, 0.02, 0.0], "cycles": 25}


def human(beside: str) -> dict[str, Any]:
    """Return the participants in the plant for a key of `cases.BESIDE`."""
    if beside == "alone":
        return {}
    grips = {"guide": {"held": "panda_link8", "handle": [0.08, -0.08, 0.04]}} if beside != "arm" else {}
    control, drive = {"parameters": {"reference": REFERENCE}}, "muscle" if beside == "muscles" else "torque"
    one = {"type": "hric_human/Human", "position": [0.85, -0.2], "control": control, "grips": grips, "drive": drive}
    return {"human": one}


@contextmanager
def human_law(muscles: bool) -> Iterator[Block]:
    """Measure the human's control law: senses, impedance around a moving hand, strength, and optionally muscles."""
    body = describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male", parts="right_arm"))
    root = Pose((0.85, -0.2, 0.7), from_rotation_vector((0.0, 0.0, np.pi)))
    law = HumanControl(body, {"parameters": {"reference": REFERENCE}}, 0, root)
    law.start(0.0)
    q, dq = law.posture, [0.0] * 7
    drive = MuscleDrive(MuscleSet(body, load(BUILT_IN)), 1e-3) if muscles else None

    def run(n: int) -> None:
        for k in range(n):
            tau = law.update(1e-3 * k, q, dq)
            if drive is not None:
                drive.update(q, dq, tau)

    yield timed(run)


@contextmanager
def cycle(robot: str, simulator: str, beside: str = "alone", **plant: Any) -> Iterator[Block]:
    """Measure the whole control cycle of a robot in `cases.ROBOTS` with the persons of `cases.BESIDE`."""
    if plant.get("friction") == "identified":
        plant["friction_parameters"] = panda_description.friction_parameters()
    whole = WholeCycle(FRANKA if robot == "franka" else GENERIC, simulator, plant, human(beside))
    with quiet_collector():  # as `RobotApp` runs it
        yield timed(whole.run, 100 if simulator == "opensim" else BLOCK)
    whole.hw.shutdown()
