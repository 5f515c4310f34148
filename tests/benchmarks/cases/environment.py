"""Benchmark cases of a learning environment: steps of 40 ms with action, observation and reward, and resets."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import TriggerRequest

from cases import Block
from cases.arms import SETPOINT, timed
from hric_assessment.ergonomics.instant import InstantScore
from hric_assessment.ergonomics.rula import Rula
from hric_core import plugins
from hric_core.geometry import Pose, stamped
from hric_core.processes import quiet_collector
from hric_gym.environment import CollaborationEnv
from hric_human.participant.settings import HUMAN, HumanSettings
from hric_run.definition import experiment
from hric_run.simulation import Simulation
from hric_supervisor.arm import ArmShape
from hric_supervisor.instant import InstantSeparation

FILE = Path(__file__).parents[1] / "environment.yaml"
CYCLES = 40
"""Number of control cycles of 1 ms in a step of the environment."""
CARTESIAN = {
    "controllers": ["cartesian_impedance_controller"],
    "parameters": {"cartesian_impedance_controller": {"filter_time": 0.02}},
}
"""Controller of the Cartesian cases, in place of that of the file."""
STEPS = 10
"""Number of steps of the environment in a block."""


@contextmanager
def bare_panda() -> Iterator[Block]:
    """Measure PyBullet's stepSimulation of the Panda of pybullet_data, without motors, which cost as much again."""
    import pybullet
    import pybullet_data

    client = pybullet.connect(pybullet.DIRECT)
    path = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
    for joint in range(pybullet.getNumJoints(body, client)):
        if pybullet.getJointInfo(body, joint, client)[2] != pybullet.JOINT_FIXED:
            pybullet.setJointMotorControl2(body, joint, pybullet.VELOCITY_CONTROL, force=0.0, physicsClientId=client)
    pybullet.setTimeStep(1e-3, physicsClientId=client)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)

    def run(n: int) -> None:
        for joint, q in enumerate(SETPOINT):
            pybullet.resetJointState(body, joint, q, physicsClientId=client)
        for _ in range(n):
            pybullet.stepSimulation(client)

    yield timed(run)
    pybullet.disconnect(client)


class Environment:
    """Arm, and optionally a person, in steps of 40 ms with random actions.

    Args:
        law: "joint" or "cartesian".
        drive: drive of the person, "torque" or "muscle"; empty: there is no person.
    """

    def __init__(self, law: str, drive: str) -> None:
        content = yaml.safe_load(FILE.read_text())
        content["robot"]["plant_type"] = plugins.engines()["mujoco"].name
        if law == "cartesian":
            content |= CARTESIAN
        if drive:
            content["human"]["drive"] = drive
        else:
            del content["human"]
        self.simulation = Simulation(experiment.parse(FILE.stem, content))
        node, hw = self.simulation.node, self.simulation.app.hw
        self._hw, self._law, self._random = hw, law, np.random.default_rng(0)
        self._joint = node.advertise("joint_pd_controller/command", Float64MultiArray)
        self._pose = node.advertise("cartesian_impedance_controller/equilibrium_pose", PoseStamped)
        self._person = bool(drive)
        if drive:
            settings = HumanSettings.of(self.simulation.definition.human, "human")
            body = settings.body()
            self._q, self._dq = [0.0] * len(body.joints), [0.0] * len(body.joints)
            self._separation = InstantSeparation(ArmShape(hw.description, hw.states.names), body)
            self._root = settings.root(body)
            self._rula = InstantScore(Rula(), body.joints, "right")

    def step(self) -> tuple[Any, float]:
        """Act, advance by 40 ms and return observation and reward."""
        if self._law == "joint":
            q = np.array(self._hw.states.position) + self._random.uniform(-0.02, 0.02, 7)
            self._joint.publish(Float64MultiArray(data=q.tolist()))
        else:
            (x, y, z), turn = Pose.of_column_major(self._hw.robot_state.O_T_EE)
            dx, dy, dz = self._random.uniform(-0.01, 0.01, 3).tolist()
            goal = Pose((x + dx, y + dy, z + dz), turn)
            self._pose.publish(stamped.pose_stamped(stamped.header(self.simulation.node.now(), ""), goal))
        self.simulation.run(1e-3 * CYCLES)
        states, pose = self._hw.states, np.array(self._hw.robot_state.O_T_EE)
        arm = np.array([states.position, states.velocity, states.effort])
        reward = -float(np.linalg.norm(pose[12:15] - (0.5, 0.0, 0.4)))
        if not self._person:
            return (arm, pose), reward
        self._hw.plant.read_joints(HUMAN, self._q, self._dq)
        person = np.array([self._q, self._dq])
        distance = self._separation(states.position, self._q, self._root)
        return (arm, pose, person), reward + distance - self._score()

    def _score(self) -> float:
        return float(self._rula(self._q))

    def reset(self) -> None:
        """Put arm and person to their start."""
        self._hw.reset()

    def start(self) -> None:
        """Begin the motion of the person."""
        if self._person:
            self.simulation.node.call(f"hric/{HUMAN}/start", TriggerRequest())


@contextmanager
def step(law: str, drive: str = "") -> Iterator[Block]:
    """Measure a millisecond of robot time in an environment, with its share of action, observation and reward."""
    environment = Environment(law, drive)
    environment.start()

    def block() -> float:
        begin = time.thread_time()
        for _ in range(STEPS):
            environment.step()
        return (time.thread_time() - begin) / (CYCLES * STEPS)

    with quiet_collector():
        yield block
    environment.simulation.close()


@contextmanager
def reset(drive: str = "") -> Iterator[Block]:
    """Measure a reset in place after some steps."""
    environment = Environment("joint", drive)

    def block() -> float:
        for _ in range(2):
            environment.step()
        begin = time.thread_time()
        environment.reset()
        return time.thread_time() - begin

    with quiet_collector():
        yield block
    environment.simulation.close()


@contextmanager
def episode(population: str) -> Iterator[Block]:
    """Measure the reset of `CollaborationEnv`, with another motion of the person in each episode.

    population: population from which the body is drawn; empty: the body remains the same."""
    environment = CollaborationEnv("Reach", population=population)

    def block() -> float:
        begin = time.thread_time()
        environment.reset()
        return time.thread_time() - begin

    environment.reset(seed=0)
    with quiet_collector():
        yield block
    environment.close()
