"""What the control cycle costs beside the engine's bare step, as ratios measured in one run.

    python tests/benchmarks/cycle_cost.py

Each round times a block of bare steps and a block of whole cycles one after the other, in CPU time of the thread; the
ratio of a round compares what the machine was like in the same moment. Medians over all rounds are reported: a choice
of rounds by one of the two times would prefer those in which the other was disturbed.
"""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pybullet
from std_msgs.msg import Float64MultiArray

import panda_description
from hric_control import plugins
from hric_control.local.node import LocalNode
from hric_control.manager.controller_manager import ControllerManager
from hric_control.urdf import read
from pybullet_ros_control.urdf_model import prepare

JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
SETPOINT = [0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398]
GENERIC, FRANKA = "pybullet_ros_control/RobotHWSim", "franka_sim/FrankaHWSim"
BLOCK = 400
"""Cycles per timed block."""


@dataclass(frozen=True)
class Cost:
    """Cost of a whole cycle.

    Attributes:
        bare_us: one bare stepSimulation, median over the rounds [us of CPU time].
        cycle_us: one whole cycle, likewise [us of CPU time].
        ratio: median of the ratios of the rounds [1].
    """

    bare_us: float
    cycle_us: float
    ratio: float

    @property
    def real_time_factor(self) -> float:
        """Robot time per CPU time at 1 ms a cycle [1]."""
        return 1000.0 / self.cycle_us


def arm_urdf() -> str:
    """The Panda without collision shapes, for the generic robot, with limits and transmissions."""
    return panda_description.load(
        hand=False, meshes=False, collision=False, robot_sim_type="pybullet_ros_control/RobotHWSim"
    )


class BareArm:
    """The same arm in the engine, stepped and nothing else."""

    def __init__(self, urdf: str, folder: Any) -> None:
        path = folder / "arm.urdf"
        # The plant's own model, whose fixed links are merged: the bare arm has no joint more than the one it is
        # compared with.
        path.write_text(prepare(read(urdf), collision=False).xml, encoding="utf-8")
        self.client = pybullet.connect(pybullet.DIRECT)
        self.body = pybullet.loadURDF(
            str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=self.client
        )
        pybullet.setTimeStep(1e-3, physicsClientId=self.client)
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self.client)
        joints = [
            i
            for i in range(pybullet.getNumJoints(self.body, self.client))
            if pybullet.getJointInfo(self.body, i, self.client)[2] != 4
        ]
        for joint, q in zip(joints, SETPOINT, strict=True):
            pybullet.resetJointState(self.body, joint, q, physicsClientId=self.client)
            pybullet.setJointMotorControl2(
                self.body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=self.client
            )

    def run(self, n: int) -> None:
        """Step n times."""
        for _ in range(n):
            pybullet.stepSimulation(self.client)


class WholeCycle:
    """read, manager with the PD law, limits with the torque rate, write, physics: what a headless run does each
    millisecond.

    On RobotHWSim the law adds gravity by KDL; FrankaHWSim does so itself, and its control box checks and estimates.
    """

    def __init__(
        self,
        urdf: str,
        plant: dict[str, Any],
        robot_hw: str = GENERIC,
        plant_type: str = "pybullet_ros_control/PyBulletPlant",
    ) -> None:
        node = LocalNode(
            {
                "robot_description": urdf,
                "joint_pd_controller": {
                    "type": "hric_controllers/JointPDController",
                    "joints": JOINTS,
                    "kp": 50.0,
                    "kd": 5.0,
                    "gravity": robot_hw == GENERIC,
                    "rotatum_limit": 1000.0,
                    "profile": {"enabled": True},
                    "state_publish_rate": 0,
                },
                "robot": {
                    "q_start": [*SETPOINT[:3], -2.0, *SETPOINT[4:]],
                    "real_time_factor": 0.0,
                    "plant_type": plant_type,
                    "plant": plant,
                },
                "joint_limits": panda_description.joint_limit_parameters("panda"),
            }
        )
        self.hw = plugins.find(plugins.ROBOT_HW, robot_hw)()
        self.hw.init(node, node.child("robot"))
        self.manager = ControllerManager(self.hw, node)
        self.manager.load("joint_pd_controller")
        self.manager.switch(["joint_pd_controller"], [], loop_running=False)
        self._left = 0
        self.run(2)  # the controllers start in the first cycle
        node.advertise("joint_pd_controller/command", Float64MultiArray).publish(Float64MultiArray(data=SETPOINT))

    def run(self, n: int) -> None:
        """Run n cycles of the robot's own loop."""
        self._left = n
        self.hw.run(self._on_cycle)

    def _on_cycle(self, now: float, period: float, reset: bool) -> bool:
        self.manager.update(now, period, reset)
        self._left -= 1
        if self._left <= 0:
            self.hw.stop()
        return True


def _seconds(work: Callable[[int], None]) -> float:
    begin = time.thread_time()
    work(BLOCK)
    return (time.thread_time() - begin) / BLOCK


def measure(rotor_inertia: float, folder: Any, rounds: int = 60, robot_hw: str = GENERIC) -> Cost:
    """Compare a whole cycle with a bare step.

    Args:
        rotor_inertia: of every joint [kg m^2].
        folder: where the bare engine's file may stand.
        rounds: pairs of blocks.
        robot_hw: whose cycle.
    """
    urdf = arm_urdf()
    bare, whole = BareArm(urdf, folder), WholeCycle(urdf, {"rotor_inertia": rotor_inertia}, robot_hw)
    bare.run(BLOCK)
    whole.run(BLOCK)
    pairs = [(_seconds(bare.run), _seconds(whole.run)) for _ in range(rounds)]
    whole.hw.shutdown()
    pybullet.disconnect(bare.client)
    bare_s, cycle_s = (statistics.median(column) for column in zip(*pairs, strict=True))
    return Cost(bare_s * 1e6, cycle_s * 1e6, statistics.median(cycle / step for step, cycle in pairs))


def share_of_the_accurate_step(rotor_inertia: float, rounds: int = 60) -> float:
    """Cost of a whole cycle with the plant's step of second order, as a multiple of one with the engine's own step [1].

    Args:
        rotor_inertia: of every joint [kg m^2].
        rounds: pairs of blocks.
    """
    plants = [
        {"rotor_inertia": rotor_inertia, "integrator": integrator} for integrator in ("semi_implicit", "accurate")
    ]
    own, accurate = (WholeCycle(arm_urdf(), plant) for plant in plants)
    for cycle in (own, accurate):
        cycle.run(BLOCK)
    pairs = [(_seconds(own.run), _seconds(accurate.run)) for _ in range(rounds)]
    for cycle in (own, accurate):
        cycle.hw.shutdown()
    return statistics.median(second / first for first, second in pairs)


def main() -> None:
    """Print the table."""
    import tempfile
    from pathlib import Path

    print("robot        rotor inertia  bare step  whole cycle  ratio  real-time factor")
    print("                    kg m^2         us           us      1                 1")
    with tempfile.TemporaryDirectory() as folder:
        for robot, rotor in ((GENERIC, 0.0), (GENERIC, 0.1), (FRANKA, 0.1)):
            cost = measure(rotor, Path(folder), robot_hw=robot)
            times = f"{cost.bare_us:10.1f} {cost.cycle_us:12.1f} {cost.ratio:6.2f} {cost.real_time_factor:17.1f}"
            print(f"{robot.split('/')[1]:11s} {rotor:14.1f} {times}")
    shares = ", ".join(
        f"{share_of_the_accurate_step(rotor):.2f} with rotor inertia {rotor:g} kg m^2" for rotor in (0.0, 0.1)
    )
    print(f"whole cycle with the step of second order beside one with the engine's own: {shares}")


if __name__ == "__main__":
    main()
