"""Interface of a physics engine that simulates a robot.

Engines are plugins, found by name at start-up; this module imports none."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hric_core.errors import HricError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Load:
    """Physical payload fixed to a link.

    Attributes:
        mass: mass [kg].
        com: centre of mass in the link frame, 3 floats [m].
        inertia: inertia about the centre of mass, axes of the link frame, 9 floats row-major [kg m^2].
    """

    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 9


@dataclass(frozen=True)
class Surface:
    """Contact properties of a body's surface.

    Attributes:
        stiffness: stiffness of penalty contact [N/m]; None for the engine's rigid contact.
        damping: damping of penalty contact [N s/m].
        friction: friction coefficient [1]; a pair of bodies has the product of both.
    """

    stiffness: float | None = None
    damping: float = 0.0
    friction: float = 0.5


@dataclass(frozen=True)
class Contact:
    """Contact point between two bodies.

    Attributes:
        body_a, body_b: "model::link" names.
        position: world frame, 3 floats [m].
        normal: from b to a, world frame, unit vector of 3 floats.
        depth: penetration, positive when inside [m].
        force: normal force on a, along `normal`, at the end of the step or, if the maximum within the step is known,
            that maximum [N].
        kind: "penalty": force of a spring, comparable with a sensor's reading; "rigid": force that stops the bodies
            within one step, which in an impact is far above the elastic one.
        impulse: normal force integrated over the step [N s]; for a spring it differs from step times `force`.
        closing: approach speed along the normal at the start of the step [m/s]; None for rigid contact, which engines
            report after they have stopped it.
    """

    body_a: str
    body_b: str
    position: tuple[float, float, float]
    normal: tuple[float, float, float]
    depth: float
    force: float
    kind: str = "rigid"
    impulse: float = 0.0
    closing: float | None = None


class JointReaction(NamedTuple):
    """Load that the parent link exerts on the child link through a joint, its drive included.

    Attributes:
        joint: joint name in the description.
        link: child link.
        position: origin of the child link, reference point of the torque, world frame, 3 floats [m].
        force, torque: load on the child, world frame, 3 floats each [N], [N m].
    """

    joint: str
    link: str
    position: tuple[float, float, float]
    force: tuple[float, float, float]
    torque: tuple[float, float, float]


@dataclass(frozen=True)
class Bushing:
    """Spring and damper between two bodies, as a hand around a handle; slips when its limits are exceeded.

    Attributes:
        body_a, body_b: "link" of the robot or "model::link".
        T_a_grip, T_b_grip: the grip's frame in the frames of both links, shape (4, 4); relaxed where both coincide.
        stiffness, damping: translational, between both grip frames [N/m], [N s/m].
        rotational_stiffness, rotational_damping: rotational, between both grip frames [N m/rad], [N m s/rad].
        force_limit, torque_limit: largest force and torque before it slips [N], [N m].
    """

    body_a: str
    body_b: str
    T_a_grip: FloatArray
    T_b_grip: FloatArray
    stiffness: float = 1e4
    damping: float = 100.0
    rotational_stiffness: float = 50.0
    rotational_damping: float = 0.25
    force_limit: float = math.inf
    torque_limit: float = math.inf


class BushingLoad(NamedTuple):
    """State of a bushing after the last step.

    Attributes:
        force, torque: load on body a at `point`, world frame, 3 floats each [N], [N m]; body b has the opposite load
            there.
        point: origin of body b's grip frame, world frame, 3 floats [m].
        stretch: distance between both grip frames [m].
        slipped: accumulated slip since it was connected [m].
        turned: accumulated rotational slip since it was connected [rad].
    """

    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    point: tuple[float, float, float]
    stretch: float
    slipped: float
    turned: float


class Mode(Enum):
    """Meaning of the value commanded to a joint."""

    EFFORT = "effort"
    VELOCITY = "velocity"
    POSITION = "position"
    BRAKE = "brake"


class Plant(ABC):
    """Physics of a robot: joints, friction, rotor inertia, contact. No control, no limits on commands, no ROS.

    Features that only some engines offer are the types `DrivenPlant`, `ReactingPlant` and `Articulated` below: their
    plants derive from these.

    Constructed by the RobotHW as `PlantClass(urdf_xml, joint_names, config)`:
        urdf_xml: robot description (pure URDF).
        joint_names: the actuated joints, in the order of all vectors here.
        config: the `plant` parameters (time_step, rotor_inertia, friction, world, gui, ...); unknown keys are refused
            by name.
    """

    joint_names: tuple[str, ...]
    time_step: float
    """Step for which the plant was set up [s]; `step` advances by it."""
    integrator: str = "accurate"
    """Integrator in use, one of the choices of the parameter `integrator`."""
    gravity: Sequence[float] = (0.0, 0.0, -9.81)
    """Gravity in the world frame, 3 floats [m/s^2]."""

    @abstractmethod
    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put the robot at q, dq (zero by default) and the world back to its start; clear wrenches and contacts."""

    @abstractmethod
    def set_configuration(self, q: Sequence[float]) -> None:
        """Put the robot at q at rest and leave the world unchanged."""

    @abstractmethod
    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place.

        q: joint position at the measuring instant (a semi-implicit engine gives q - dt*dq/2) [rad]; dq [rad/s];
        tau: joint effort in the last step as an arm's sensors measure it, on the link's side of the rotor [N m]: motor
            effort less rotor inertia times acceleration; friction, which acts behind the sensor, is included.
        """

    @abstractmethod
    def motor_effort(self) -> list[float]:
        """Return the motors' efforts in the last step: those of `apply`, or of a drive or brake, n floats [N m]."""

    @abstractmethod
    def engine_state(self) -> tuple[list[float], list[float]]:
        """Return the raw q, dq of the engine, without the half-step correction."""

    @abstractmethod
    def apply(self, tau: Sequence[float]) -> None:
        """Set the joint efforts for the next step [N m]; required before every step."""

    @abstractmethod
    def step(self) -> None:
        """Advance by `time_step`."""

    @abstractmethod
    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock (True) or free (False) each joint, as an arm's brakes do; locked joints ignore efforts."""

    @abstractmethod
    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Fix a payload to `link` (by default the chain's last link) without changing q and dq; None removes it."""

    @abstractmethod
    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Apply a wrench to "link" or "model::link" for `duration` seconds (negative: until cleared).

        force [N], torque [N m]: world frame. point: point of application, link frame [m].
        """

    @abstractmethod
    def clear_wrenches(self, body: str | None = None) -> None:
        """Clear the wrenches on one body, or on all."""

    @abstractmethod
    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step that involve the robot or a spawned model."""

    def spawn(
        self,
        name: str,
        urdf_xml: str,
        T_world_model: FloatArray,
        *,
        fixed: bool = False,
        surfaces: Mapping[str, Surface] = {},
    ) -> None:
        """Add a model.

        Args:
            name: name of the model, unique in the world.
            urdf_xml: description of the model (pure URDF).
            T_world_model: pose of its root link, shape (4, 4).
            fixed: fix the root link to the world.
            surfaces: surfaces of its links, by name; other links are rigid. Rules of the world file and of the plant's
                parameters override them.

        Raises:
            HricError: the name is taken, the pose is no transform, the URDF is bad, or a surface is of a link that the
                model does not have.
        """
        if np.shape(T_world_model) != (4, 4) or not np.isfinite(T_world_model).all():
            raise HricError(f"model {name}: its pose must be a finite 4 x 4 transform")
        self._spawn(name, urdf_xml, np.array(T_world_model, dtype=float), fixed, surfaces)

    @abstractmethod
    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model whose pose has been checked; see `spawn`."""

    @abstractmethod
    def delete(self, name: str) -> None:
        """Remove a spawned model. Raises UnknownNameError with the names that exist."""

    @abstractmethod
    def model_names(self) -> list[str]:
        """Return the names of the spawned models, without the robot."""

    @abstractmethod
    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return the pose and the twist of a link.

        The pose is T_world_link, shape (4, 4); the twist is at the link frame's origin in the world frame, linear then
        angular, shape (6,)."""

    def base_link(self, model: str) -> str:
        """Return the name of a model's root link; for a plain shape it is "link"."""
        return "link"

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest penalty force in any step since the last call [N], by pair of bodies as in `contacts`."""
        return {}

    @abstractmethod
    def mass_matrix(self) -> FloatArray:
        """Return the engine's joint-space mass matrix at the present q, for checks, shape (n, n) [kg m^2].

        Without rotor inertia; joints that mimic the actuated ones are included."""

    def close(self) -> None:  # noqa: B027  (an engine without resources needs no override)
        """Release the engine."""


class DrivenPlant(Plant):
    """Plant whose joints offer stiff drives in addition to efforts."""

    @abstractmethod
    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the meaning of `apply` for each joint from now on."""


class ReactingPlant(Plant):
    """Plant that measures the loads in its joints."""

    @abstractmethod
    def joint_reactions(self) -> list[JointReaction]:
        """Return the loads of the robot's moving joints in the last step; empty before the first step."""


class Articulated(Plant):
    """Plant with articulated models: their joints can be read, placed and driven, their bodies connected.

    Names of models and links, and connections, outlive `reset`, `spawn`, `delete` of another model, and `set_load`;
    bodies connected to a deleted model are free. A joint of a spawned model has the damping and Coulomb friction of its
    description if the plant's `friction` says so for the robot, and `plants.StopLaw` at its ends.
    """

    @abstractmethod
    def model_joints(self, model: str) -> tuple[str, ...]:
        """Return the names of a spawned model's moving joints, parents before children: the order of its vectors here.

        Raises:
            UnknownNameError: no such model.
        """

    @abstractmethod
    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """Write the joints' state at the measuring instant into the lists in place [rad or m], [rad/s or m/s].

        As `read_state` does for the robot."""

    @abstractmethod
    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put the joints at q, dq (zero by default).

        After `reset` a model is where it was spawned, with its joints as they were placed last.

        Raises:
            CommandError: not one finite number per joint.
        """

    @abstractmethod
    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Set joint efforts [N m or N] that act from the next step until the next call; zero after `reset`.

        Raises:
            CommandError: not as many efforts as joints.
        """

    @abstractmethod
    def connect(self, name: str, bushing: Bushing) -> None:
        """Connect two bodies by a bushing from the next step on.

        Connected links have no contact with each other, nor with links fixed to them or attached to them by one joint.

        Raises:
            HricError: the name is taken; no such body; both bodies are the same; a bad transform or number.
        """

    @abstractmethod
    def disconnect(self, name: str) -> None:
        """Remove a connection. Raises UnknownNameError with the names that exist."""

    @abstractmethod
    def connections(self) -> list[str]:
        """Return the names of the connections."""

    @abstractmethod
    def bushing_load(self, name: str) -> BushingLoad:
        """Return the load of a bushing in the last step; zero before the first step. Raises UnknownNameError."""
