"""Action modes: the meaning of a policy's numbers, and the controller that executes them through the control box."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from franka_hw_interface.interfaces import FrankaModelInterface
from hric_controllers.policy.contract import STREAM, moved, within
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, from_rotation_vector
from hric_core.geometry.quaternions import product
from hric_gym.spaces import Box, unit_box
from hric_run.observation import SimulationState
from hric_run.simulation import Simulation

PD, IMPEDANCE = "joint_pd_controller", "cartesian_impedance_controller"
JOINT_SPEED = 1.0
"""Joint velocity that an action of 1 commands [rad/s] (project default)."""
SPEED, ROTATION = 0.5, 1.0
"""Linear [m/s] and angular [rad/s] velocity of the equilibrium pose for an action of 1 (project default)."""
STREAM_SPEED = 0.7
"""Velocity of the end effector for an action of 1 in EndEffectorStream [m/s]: limit of cartesian_streaming_controller.
"""
LEAD = 0.1
"""Largest distance of the equilibrium position from the end effector, per axis [m] (project default)."""
STIFFNESS = (50.0, 1000.0), (5.0, 60.0)
"""Range of the translational [N/m] and rotational [N m/rad] stiffness for actions from -1 to 1 (project default)."""
TORQUE = 0.2
"""Share of the joints' effort limits that an action of 1 commands [1] (project default)."""


class ActionMode(ABC):
    """Meaning of a policy's numbers from -1 to 1; the arm's control box is always between them and the arm.

    Args:
        simulation: simulation in which the controller of this mode is loaded.

    Attributes:
        controller: name of the controller.
        parameters: parameters of the controller that this mode needs; they replace those of the experiment.
        acted: names of those parameters that each action sets, so that another value would have no effect.
        space: Gymnasium space of the actions.
        whole: True if the command of a step is sent at once, even if the step is long.
        command: present command, as in the field `command` of the observation.
    """

    controller: ClassVar[str] = PD
    parameters: ClassVar[Mapping[str, object]] = {}
    acted: ClassVar[frozenset[str]] = frozenset()
    space: ClassVar[Box] = unit_box(7)
    whole: ClassVar[bool] = False
    command: FloatArray

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        limits = list(simulation.limits.values())[:7]
        self._low, self._high, self._effort = (
            np.array([limit[key] for limit in limits]) for key in ("lower", "upper", "effort")
        )

    @classmethod
    def check(cls, parameters: Mapping[str, object]) -> None:
        """Raise HricError if the experiment changes a parameter of the controller that each action sets."""
        for name in sorted(cls.acted):
            if parameters[name] != cls.parameters[name]:
                raise HricError(
                    f"parameters.{cls.controller}.{name}: {parameters[name]} has no effect, since each action sets it; "
                    "valid: an action mode with constant stiffness, end_effector"
                )

    def prepare(self) -> None:  # noqa: B027  (most modes change nothing that a reset keeps)
        """Undo changes of an episode that a reset of the simulation does not undo; called before each reset."""

    @abstractmethod
    def start(self, observation: SimulationState) -> None:
        """Set the command so that the arm stays where it is at the start of an episode."""

    @abstractmethod
    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Send the command of an action to the controller.

        Args:
            action: numbers from -1 to 1, of the shape of `space`.
            observation: present state of the simulation.
            period: robot time until the next call [s].
        """


class JointVelocity(ActionMode):
    """Joint velocities; their integral is the setpoint of the joint PD controller."""

    parameters: ClassVar = {"profile": {"enabled": False}, "kp": 200.0, "kd": 20.0}

    def start(self, observation: SimulationState) -> None:
        """Set the setpoint to the present joint positions."""
        self.command = np.clip(observation.arm.q, self._low, self._high)

    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Move the setpoint by the commanded velocity times the period."""
        self.command = (self.command + JOINT_SPEED * period * action).clip(self._low, self._high)
        self._simulation.command(PD, self.command.tolist())


class JointPosition(JointVelocity):
    """Joint positions, -1 to 1 over each joint's range, to which the joint PD controller moves by its speed profile."""

    parameters: ClassVar = {"profile": {"enabled": True, "velocity": 1.0, "acceleration": 5.0}, "kp": 200.0, "kd": 20.0}

    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Set the setpoint to the commanded joint positions."""
        position = self._low + 0.5 * (action + 1.0) * (self._high - self._low)
        self.command = position.clip(self._low, self._high)
        self._simulation.command(PD, self.command.tolist())


class EndEffectorStream(ActionMode):
    """Linear velocity of the end effector in the axes of the base, converted to joint positions for each period.

    joint_streaming_controller moves to them with limited velocity, acceleration and jerk, as
    `hric_controllers/PolicyController` does on the arm.
    """

    whole: ClassVar[bool] = True  # as PolicyController does
    controller: ClassVar[str] = "joint_streaming_controller"
    space: ClassVar[Box] = unit_box(3)

    def start(self, observation: SimulationState) -> None:
        """Set the commanded joint positions to the present ones."""
        self._model = self._simulation.app.hw.get(FrankaModelInterface).model
        self.command = within(observation.arm.q, self._low, self._high)

    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Move the commanded joint positions by the velocity times the period."""
        after = moved(self._model, self.command, STREAM_SPEED * period * action, period)
        self.command = within(after, self._low, self._high)
        self._simulation.command(self.controller, self.command.tolist())


class EndEffectorDelta(ActionMode):
    """Velocity of the equilibrium pose of the Cartesian impedance controller: 3 linear, 3 angular, axes of the base."""

    controller: ClassVar[str] = IMPEDANCE
    parameters: ClassVar = {"filter_time": 0.02}
    space: ClassVar[Box] = unit_box(6)

    def start(self, observation: SimulationState) -> None:
        """Set the equilibrium pose to the present pose of the end effector."""
        self._pose = Pose.of_column_major(_matrix(observation).T.ravel().tolist())
        self._hold()

    def _hold(self, *others: float) -> None:
        self.command = np.array([*self._pose.position, *self._pose.orientation, *others])

    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Move the equilibrium pose by the velocity times the period, at most LEAD [m] ahead of the end effector."""
        present, numbers = _matrix(observation)[:3, 3].tolist(), action.tolist()
        moves = zip(self._pose.position, present, numbers[:3], strict=True)
        x, y, z = [min(max(p + SPEED * period * v, now - LEAD), now + LEAD) for p, now, v in moves]
        rotation = from_rotation_vector([ROTATION * period * v for v in numbers[3:6]])
        self._pose = Pose((x, y, z), product(rotation, self._pose.orientation))
        self._hold()
        self._simulation.command(IMPEDANCE, self._pose)


def _stiffness(action: FloatArray) -> dict[str, float]:
    """Return the stiffness parameters of the Cartesian impedance controller; `action`: two numbers from -1 to 1."""
    names = ("translational_stiffness", "rotational_stiffness")
    ranges = zip(names, STIFFNESS, action.tolist(), strict=True)
    return {name: low * (high / low) ** (0.5 * (value + 1.0)) for name, (low, high), value in ranges}


class ImpedanceTarget(EndEffectorDelta):
    """Actions of EndEffectorDelta, then translational and rotational stiffness on a logarithmic scale (STIFFNESS)."""

    parameters: ClassVar = EndEffectorDelta.parameters | _stiffness(np.zeros(2))
    acted: ClassVar = frozenset(_stiffness(np.zeros(2)))
    space: ClassVar[Box] = unit_box(8)

    def prepare(self) -> None:
        """Set the stiffness back to the middle of its range, which the controller has at its start."""
        self._soften(np.zeros(2))

    def start(self, observation: SimulationState) -> None:
        """Set the equilibrium pose to the present pose of the end effector."""
        self._soften(np.zeros(2))
        super().start(observation)

    def _soften(self, action: FloatArray) -> None:
        self._stiffness = _stiffness(action)
        self._simulation.node.set_live(IMPEDANCE, self._stiffness)

    def _hold(self, *others: float) -> None:
        super()._hold(*self._stiffness.values(), *others)

    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Set the stiffness, and move the equilibrium pose by the velocity times the period."""
        self._soften(action[6:])
        super().apply(action, observation, period)


class JointTorque(ActionMode):
    """Joint torques in addition to gravity compensation; hric_gym/JointTorqueController limits their rate."""

    controller: ClassVar[str] = "joint_torque_controller"
    parameters: ClassVar = {
        "type": "hric_gym/JointTorqueController",
        "joints": [f"panda_joint{number}" for number in range(1, 8)],
    }

    def start(self, observation: SimulationState) -> None:
        """Set the commanded torques to zero."""
        self.command = np.zeros(7)

    def apply(self, action: FloatArray, observation: SimulationState, period: float) -> None:
        """Command the shares TORQUE of the effort limits, times the action."""
        self.command = TORQUE * self._effort * action
        self._simulation.command(self.controller, self.command.tolist())


def _matrix(observation: SimulationState) -> FloatArray:
    T = observation.arm.T_base_ee
    assert T is not None, "the environment has refused other robots"
    return T


MODES: dict[str, type[ActionMode]] = {
    "joint_velocity": JointVelocity,
    "joint_position": JointPosition,
    "end_effector": EndEffectorDelta,
    STREAM: EndEffectorStream,
    "impedance": ImpedanceTarget,
    "torque": JointTorque,
}
"""Action modes by the name that the argument `action` of an environment has."""
