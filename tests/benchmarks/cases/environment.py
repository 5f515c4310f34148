"""Benchmark cases of the learning environment `hric_gym.CollaborationEnv`: its steps and its resets."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cases import Block
from cases.arms import SETPOINT, timed
from hric_gym.environment import CollaborationEnv

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


@contextmanager
def opened(**arguments: str) -> Iterator[CollaborationEnv]:
    """Open the task Reach with these arguments, and begin an episode."""
    environment = CollaborationEnv("Reach", **arguments)
    environment.action_space.seed(0)
    environment.reset(seed=0)
    yield environment
    environment.close()


@contextmanager
def step(**arguments: str) -> Iterator[Block]:
    """Measure a millisecond of robot time in steps with random actions, with observation, costs and reward."""
    with opened(**arguments) as environment:

        def block() -> float:
            spent = 0.0
            for _ in range(STEPS):
                action = environment.action_space.sample()
                begin = time.thread_time()
                *_, terminated, truncated, _ = environment.step(action)
                spent += time.thread_time() - begin
                if terminated or truncated:
                    environment.reset()
            return spent / (STEPS * round(1e3 * environment.period))

        yield block


@contextmanager
def reset(**arguments: str) -> Iterator[Block]:
    """Measure the begin of an episode after some steps, with another motion of the person in each episode."""
    with opened(**arguments) as environment:

        def block() -> float:
            for _ in range(2):
                environment.step(environment.action_space.sample())
            begin = time.thread_time()
            environment.reset()
            return time.thread_time() - begin

        yield block
