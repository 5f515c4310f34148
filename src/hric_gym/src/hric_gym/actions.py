"""Actions of the robot: what a policy commands, and the controller that executes it through the control box."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from franka_hw_interface.interfaces import FrankaModelInterface
from hric_controllers.policy.contract import STREAM, moved, within
from hric_core.geometry import FloatArray, Pose, from_rotation_vector
from hric_core.geometry.quaternions import product
from hric_gym.spaces import Box, unit_box
from hric_run.observation import SimulationState
from hric_run.simulation import Simulation

PD, IMPEDANCE = "joint_pd_controller", "cartesian_impedance_controller"
JOINT_SPEED = 1.0
"""Joint velocity of an action of 1 [rad/s] (project default)."""
SPEED, ROTATION = 0.5, 1.0
"""Velocity of the equilibrium pose for an action of 1 [m/s], [rad/s] (project default)."""
STREAM_SPEED = 0.7
"""Velocity of a streamed end effector for an action of 1 [m/s]: limit of cartesian_streaming_controller."""
LEAD = 0.1
"""Largest distance of the equilibrium position from the end effector, per axis [m] (project default)."""
STIFFNESS = (50.0, 1000.0), (5.0, 60.0)
"""Range of the translational [N/m] and rotational [N m/rad] stiffness for actions from -1 to 1 (project default)."""
TORQUE = 0.2
"""Share of the joints' effort limits that an action of 1 commands [1] (project default)."""


class ActionMode(ABC):
    """Meaning of a policy's numbers from -1 to 1; the arm's control box is always between them and the arm.

    Args:
        simulation: simulation with the controller.
        period: time between two actions [s].

    Attributes:
        controller: name of the controller.
        parameters: parameters of the controller that this mode needs, over those of the experiment.
        space: space of actions.
        command: command in force.
    """

    controller: ClassVar[str] = PD
    parameters: ClassVar[Mapping[str, object]] = {}
    space: ClassVar[Box] = unit_box(7)
    command: FloatArray

    def __init__(self, simulation: Simulation, period: float) -> None:
        self._simulation, self._period = simulation, period
        limits = list(simulation.limits.values())[:7]
        self._low, self._high, self._effort = (
            np.array([limit[key] for limit in limits]) for key in ("lower", "upper", "effort")
        )

    def prepare(self) -> None:  # noqa: B027  (most modes change nothing that a reset keeps)
        """Undo what an episode changed and a reset of the simulation keeps; before each reset."""

    @abstractmethod
    def start(self, observation: SimulationState) -> None:
        """Set the command to the state at the start of an episode."""

    @abstractmethod
    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Command an action; `observation`: present state."""


class JointVelocity(ActionMode):
    """Joint velocities; their integral is the setpoint of the joint PD controller."""

    parameters: ClassVar = {"profile": {"enabled": False}, "kp": 200.0, "kd": 20.0}

    def start(self, observation: SimulationState) -> None:
        """Hold the present position."""
        self.command = np.clip(observation.arm.q, self._low, self._high)

    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Move the setpoint for one period."""
        self.command = np.clip(self.command + JOINT_SPEED * self._period * action, self._low, self._high)
        self._simulation.command(PD, self.command.tolist())


class JointPosition(JointVelocity):
    """Joint positions, -1 to 1 over each joint's range, to which the joint PD controller moves by its speed profile."""

    parameters: ClassVar = {"profile": {"enabled": True, "velocity": 1.0, "acceleration": 5.0}, "kp": 200.0, "kd": 20.0}

    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Set the setpoint."""
        self.command = np.clip(self._low + 0.5 * (action + 1.0) * (self._high - self._low), self._low, self._high)
        self._simulation.command(PD, self.command.tolist())


class EndEffectorStream(ActionMode):
    """Velocity of the end effector, axes of the base, which moves a stream of joint positions.

    The stream is commanded at limited velocity, acceleration and jerk, as by `hric_controllers/PolicyController`.
    """

    controller: ClassVar[str] = "joint_streaming_controller"
    space: ClassVar[Box] = unit_box(3)

    def start(self, observation: SimulationState) -> None:
        """Hold the present position."""
        self._model = self._simulation.app.hw.get(FrankaModelInterface).model
        self.command = within(observation.arm.q, self._low, self._high)

    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Move the target for one period."""
        after = moved(self._model, self.command, STREAM_SPEED * self._period * action, self._period)
        self.command = within(after, self._low, self._high)
        self._simulation.command(self.controller, self.command.tolist())


class EndEffectorDelta(ActionMode):
    """Displacement and rotation of the equilibrium pose of the Cartesian impedance controller, axes of the base."""

    controller: ClassVar[str] = IMPEDANCE
    parameters: ClassVar = {"filter_time": 0.02}
    space: ClassVar[Box] = unit_box(6)

    def start(self, observation: SimulationState) -> None:
        """Set the equilibrium to the present pose."""
        self._pose = Pose.of_column_major(_matrix(observation).T.ravel().tolist())
        self._hold()

    def _hold(self) -> None:
        self.command = np.array([*self._pose.position, *self._pose.orientation])

    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Move the equilibrium for one period, at most LEAD ahead of the end effector."""
        present = _matrix(observation)[:3, 3]
        position = np.array(self._pose.position) + SPEED * self._period * action[:3]
        x, y, z = np.clip(position, present - LEAD, present + LEAD).tolist()
        rotation = from_rotation_vector((ROTATION * self._period * action[3:6]).tolist())
        self._pose = Pose((x, y, z), product(rotation, self._pose.orientation))
        self._hold()
        self._simulation.command(IMPEDANCE, self._pose)


def _stiffness(action: FloatArray) -> dict[str, float]:
    """Return the live parameters of the controller for the two numbers of an action."""
    names = ("translational_stiffness", "rotational_stiffness")
    ranges = zip(names, STIFFNESS, action.tolist(), strict=True)
    return {name: low * (high / low) ** (0.5 * (value + 1.0)) for name, (low, high), value in ranges}


class ImpedanceTarget(EndEffectorDelta):
    """Equilibrium pose as EndEffectorDelta, and translational and rotational stiffness on a logarithmic scale."""

    parameters: ClassVar = EndEffectorDelta.parameters | _stiffness(np.zeros(2))
    space: ClassVar[Box] = unit_box(8)

    def prepare(self) -> None:
        """Set the stiffness to the middle of its range, with which the controller starts."""
        self._soften(np.zeros(2))

    def start(self, observation: SimulationState) -> None:
        """Set the equilibrium to the present pose."""
        self._soften(np.zeros(2))
        super().start(observation)

    def _soften(self, action: FloatArray) -> None:
        self._stiffness = _stiffness(action)
        self._simulation.node.set_live(IMPEDANCE, self._stiffness)

    def _hold(self) -> None:
        super()._hold()
        self.command = np.array([*self.command, *self._stiffness.values()])

    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Move the equilibrium for one period, and set the stiffness."""
        self._soften(action[6:])
        super().apply(action, observation)


class JointTorque(ActionMode):
    """Joint torques beyond the compensation of gravity, at the limited rate of hric_gym/JointTorqueController."""

    controller: ClassVar[str] = "joint_torque_controller"
    parameters: ClassVar = {
        "type": "hric_gym/JointTorqueController",
        "joints": [f"panda_joint{number}" for number in range(1, 8)],
    }

    def start(self, observation: SimulationState) -> None:
        """Command no torque."""
        self.command = np.zeros(7)

    def apply(self, action: FloatArray, observation: SimulationState) -> None:
        """Command the torques."""
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
"""Action modes by name."""
