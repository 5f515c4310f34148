"""Environment of a policy: its observations have only fields that the real arm can measure, scaled for the network.

The contract of a policy (`hric_controllers.policy.contract.PolicyContract`) lists these fields.
"""

import math
from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np

import hric_gym.envs
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_controllers.cartesian.workspace import Box as Region
from hric_controllers.policy.contract import FIELDS, STREAM, VERSION, FieldScale, PolicyContract, PolicyRobot, Vector
from hric_core.errors import HricError, check_known
from hric_gym.actions import STREAM_SPEED
from hric_gym.environment import STEP
from hric_gym.goals import BOX, NEAR
from hric_gym.spaces import Box, ObservationWrapper, Values, make
from hric_gym.tasks import DRAWN, FORCE, TASKS

READY = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)
"""Joint positions that are 0 in scaled observations: the start position of the arm, 7 values [rad]."""
GOALS = Region(*(tuple(corner.tolist()) for corner in BOX))
"""Box of the goals, in which a policy is trained."""
TOLERATED = 0.1
"""Contact force as share of its limit, up to which a step costs nothing in training [1] (project default). Reflexes
come from hits of 0.2 or more; a cost of all forces would teach the arm to leave a light contact quickly."""


def contract(task: str, training: Mapping[str, object]) -> PolicyContract:
    """Return the contract of policies for a task: fields of the observation with their scaling, period, action.

    Args:
        task: name of the task.
        training: settings of the training, which the policy's file also has: `steps`, `seed`, `weights`.
    """
    middle, half = 0.5 * (BOX[0] + BOX[1]), 0.25
    scaling: dict[str, tuple[Any, float]] = {
        "q": (READY, 1.0),
        "dq": ([0.0] * 7, 1.0),
        "command": (READY, 1.0),
        "ee_position": (middle.tolist(), half),
        "goal": (middle.tolist(), half),
        "goal_offset": ([0.0] * 3, half),
    }
    fields = tuple(
        FieldScale(name, FIELDS[name][1], tuple(offset), (scale,) * FIELDS[name][0])
        for name, (offset, scale) in scaling.items()
    )
    with closing(_made(task, person="none")) as env:
        robot = _robot(env)
    return PolicyContract(VERSION, fields, STEP, STREAM, STREAM_SPEED, NEAR, robot, GOALS, {"task": task, **training})


def _made(task: str, **arguments: Any) -> Any:
    """Return the environment of a task. Raises HricError if its goal is not a point, as the real arm needs."""
    check_known("task", [task], [name for name, item in TASKS.items() if item.goal == DRAWN])
    identity = next(identity for identity, name in hric_gym.envs.IDS.items() if name == task)
    return make(identity, action=STREAM, **arguments)


def _robot(env: Any) -> PolicyRobot:
    """Return the robot of an environment."""
    simulation = env.unwrapped.simulation
    hw, limits = simulation.app.hw, dict(list(simulation.limits.items())[:7])
    assert isinstance(hw, FrankaHWSim), "the environment has refused other robots"
    ranges = [(limit["lower"], limit["upper"]) for limit in limits.values()]
    return PolicyRobot.of_arm(hw.arm_id, [*limits], ranges, hw.model)


class PolicyEnv(ObservationWrapper):
    """Environment whose observation is the vector of scaled fields that a contract lists.

    Args:
        env: environment of the task.
        agreed: contract of the policy.

    Attributes:
        fields: newest observation of `env`, not scaled.
    """

    fields: Values

    def __init__(self, env: Any, agreed: PolicyContract) -> None:
        super().__init__(env)
        self._contract = agreed
        self.observation_space = Box(-np.inf, np.inf, (agreed.size,), np.float32)

    def observation(self, observation: Values) -> Vector:
        """Return the scaled fields of the contract, shape (`agreed.size`,); `observation`: that of `env`."""
        self.fields = observation
        return self._contract.observation({name: values.tolist() for name, values in observation.items()})


def force_excess(costs: Mapping[str, float]) -> float:
    """Return the force above TOLERATED, as share of its limit (up to 1) [1]; `costs`: those of a step."""
    return max(0.0, min(costs.get(FORCE, 0.0), 1.0) - TOLERATED)


def environment(agreed: PolicyContract, person: str = "scripted") -> PolicyEnv:
    """Return the environment in which a policy with this contract is trained and evaluated.

    Args:
        agreed: contract of the policy, with task and weights in its `training`.
        person: kind of person, as in `CollaborationEnv`.

    Raises:
        HricError: the contract names no task, or one whose goal is not a point. Or its robot, its goals, its speed, or
            the distance at which a goal is reached are not known or not those of the environment.
    """
    task, weights = str(agreed.training.get("task")), agreed.training.get("weights")
    env = _made(task, step=agreed.period, weights=weights, person=person)
    try:
        agreed.check_robot(_robot(env))
        for name, own, unit in (("action_scale", STREAM_SPEED, " m/s"), ("near", NEAR, " m"), ("goals", GOALS, "")):
            if (value := getattr(agreed, name)) != own:
                raise HricError(f"{name} of the policy: {value}{unit}; valid in hric_gym: {own}{unit}")
    except HricError:
        env.close()
        raise
    return PolicyEnv(env, agreed)
