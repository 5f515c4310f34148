"""What a physics engine must offer to carry a simulated robot. Engines are plugins, found by name while it starts;
nothing here imports one."""

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
    """A physical payload, fixed to a link.

    Attributes:
        mass: [kg].
        com: centre of mass in the link frame, 3 floats [m].
        inertia: about the centre of mass, axes of the link frame, 9 floats row-major [kg m^2].
    """

    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 9


@dataclass(frozen=True)
class Surface:
    """How a body's surface responds.

    Attributes:
        stiffness: of penalty contact [N/m]; None for the engine's rigid contact.
        damping: of penalty contact [N s/m].
        friction: coefficient; a pair has the product of both.
    """

    stiffness: float | None = None
    damping: float = 0.0
    friction: float = 0.5


@dataclass(frozen=True)
class Contact:
    """One contact point between two bodies.

    Attributes:
        body_a, body_b: "model::link" names.
        position: world frame, 3 floats [m].
        normal: from b to a, world frame, unit vector of 3 floats.
        depth: penetration, positive when inside [m].
        force: normal force on a, along `normal`, at the end of the step or, where it had its maximum within the step,
            this maximum [N].
        kind: "penalty": of a spring, as a sensor would read it; "rigid": what stops the bodies within a step, an impact
            far above the elastic one.
        impulse: of the normal force over the step [N s]; that of a spring differs from step times `force`.
        closing: speed along the normal at which both came towards each other as the step began [m/s]; None of rigid
            contact, which engines report after they have stopped it.
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
    """What the parent link does to the child link through a joint, its drive included.

    Attributes:
        joint: of the description.
        link: the child.
        position: origin of the child link, where the torque is meant, world frame, 3 floats [m].
        force, torque: on the child, world frame, 3 floats each [N], [N m].
    """

    joint: str
    link: str
    position: tuple[float, float, float]
    force: tuple[float, float, float]
    torque: tuple[float, float, float]


@dataclass(frozen=True)
class Bushing:
    """A spring and a damper between two bodies, as a hand around a handle; slips where it would need more than its
    limits.

    Attributes:
        body_a, body_b: "link" of the robot or "model::link".
        T_a_grip, T_b_grip: the grip's frame in the frames of both links, shape (4, 4); relaxed where both coincide.
        stiffness, damping: of the distance between the two [N/m], [N s/m].
        rotational_stiffness, rotational_damping: of the rotation between them [N m/rad], [N m s/rad].
        force_limit, torque_limit: [N], [N m].
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
    """What a bushing did in the last step.

    Attributes:
        force, torque: on body a, at `point`, world frame, 3 floats each [N], [N m]; body b has the opposite ones there.
        point: origin of body b's grip frame, world frame, 3 floats [m].
        stretch: distance between both grip frames [m].
        slipped: how far it has slipped since it was connected [m].
        turned: by how much it has turned then [rad].
    """

    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    point: tuple[float, float, float]
    stretch: float
    slipped: float
    turned: float


class Mode(Enum):
    """What the value given to a joint means."""

    EFFORT = "effort"
    VELOCITY = "velocity"
    POSITION = "position"
    BRAKE = "brake"


class Plant(ABC):
    """The physical side of a robot: joints, friction, rotor inertia, contact. No control, no limits on commands, no
    ROS.

    What only some engines offer are the types `DrivenPlant`, `ReactingPlant` and `Articulated` below: their plants
    derive from these.

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
    """Of the choices of the parameter `integrator` the one that steps it."""
    gravity: Sequence[float] = (0.0, 0.0, -9.81)
    """In the world frame, 3 floats [m/s^2]."""

    @abstractmethod
    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put the robot at q, dq (zero by default), the world back to its start; clears wrenches and contact memory."""

    @abstractmethod
    def set_configuration(self, q: Sequence[float]) -> None:
        """Put the robot at q at rest and leave the world as it is."""

    @abstractmethod
    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Write the state at the measuring instant into the lists in place.

        q: joint position at the measuring instant (a semi-implicit engine gives q - dt*dq/2) [rad]; dq [rad/s];
        tau: joint effort in the last step as an arm's sensors measure it, on the link's side of the rotor: effort of
        the motor, less rotor inertia
            times acceleration; joint friction, which acts behind the sensor, is still in it [N m].
        """

    @abstractmethod
    def motor_effort(self) -> list[float]:
        """Efforts of the motors in the last step: those of `apply`, or what a drive or a brake took, n floats [N m]."""

    @abstractmethod
    def engine_state(self) -> tuple[list[float], list[float]]:
        """Raw q, dq of the engine, without the half-step correction."""

    @abstractmethod
    def apply(self, tau: Sequence[float]) -> None:
        """Joint efforts for the next step [N m]; must be given before every step."""

    @abstractmethod
    def step(self) -> None:
        """Advance by `time_step`."""

    @abstractmethod
    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock (True) or free (False) each joint, as the brakes of an arm do; locked joints ignore efforts."""

    @abstractmethod
    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Fix a physical payload to `link` (the last link of the chain by default), keeping q and dq; None takes it
        off."""

    @abstractmethod
    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Act on "link" or "model::link" for `duration` seconds (negative: until cleared).

        force [N], torque [N m]: world frame. point: where it acts, link frame [m].
        """

    @abstractmethod
    def clear_wrenches(self, body: str | None = None) -> None:
        """End the wrenches on one body, or all."""

    @abstractmethod
    def contacts(self) -> list[Contact]:
        """Contacts of the last step that involve the robot or a spawned model."""

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
            T_world_model: of its root link, shape (4, 4).
            surfaces: of its links, by name; links that are left out are rigid. Rules of the world file and of the
                plant's parameters go over them.

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
        """What `spawn` does, with a pose that is a transform."""

    @abstractmethod
    def delete(self, name: str) -> None:
        """Remove a spawned model. Raises UnknownNameError with the names that exist."""

    @abstractmethod
    def model_names(self) -> list[str]:
        """Names of the spawned models, the robot not among them."""

    @abstractmethod
    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """(T_world_link shape (4, 4), twist at the link frame's origin in the world frame, linear then angular, shape
        (6,))."""

    def base_link(self, model: str) -> str:
        """Name of the link that carries a model; that of a plain shape is "link"."""
        return "link"

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Largest force of each pair of bodies that met by a spring, as `contacts` would have had it in any step since
        the last call [N]."""
        return {}

    @abstractmethod
    def mass_matrix(self) -> FloatArray:
        """The engine's own joint-space mass matrix at the present q, without rotor inertia, with what joints that mimic
        the actuated ones add to it, shape (n, n) [kg m^2]; for checks."""

    def close(self) -> None:  # noqa: B027  (an engine that holds nothing need not say so)
        """Release the engine."""


class DrivenPlant(Plant):
    """A plant whose joints have stiff drives of their own, beside efforts."""

    @abstractmethod
    def set_modes(self, modes: Sequence[Mode]) -> None:
        """What `apply` means for each joint from now on."""


class ReactingPlant(Plant):
    """A plant that measures the loads in its joints."""

    @abstractmethod
    def joint_reactions(self) -> list[JointReaction]:
        """Loads of the robot's moving joints in the last step; empty before the first."""


class Articulated(Plant):
    """A plant whose spawned models have joints that can be read, placed and driven, and whose bodies can be held
    together.

    Names of models and links, and what was connected, outlive `reset`, `spawn`, `delete` of another model, and
    `set_load`; what a deleted model was connected to is free. A joint of a spawned model has the damping and Coulomb
    friction of its description where the plant's `friction` says so for the robot, and `plants.StopLaw` at its ends.
    """

    @abstractmethod
    def model_joints(self, model: str) -> tuple[str, ...]:
        """Names of the moving joints of a spawned model, parents before children: the order of its vectors here.

        Raises:
            UnknownNameError: no such model.
        """

    @abstractmethod
    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """Write the joints' state at the measuring instant into the lists in place, as `read_state` does for the robot
        [rad or m], [rad/s or m/s]."""

    @abstractmethod
    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put the joints at q, dq (zero by default). After `reset` a model is where it was spawned, with its joints as
        they were placed last.

        Raises:
            CommandError: not one finite number per joint.
        """

    @abstractmethod
    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Joint efforts from the next step on, until they are given again; zero after `reset` [N m or N].

        Raises:
            CommandError: not as many as joints.
        """

    @abstractmethod
    def connect(self, name: str, bushing: Bushing) -> None:
        """Hold two bodies together from the next step on. Links that are connected do not touch each other, nor does
        what is fixed to them or hangs on them by one joint.

        Raises:
            HricError: the name is taken; no such body; both bodies are one; a transform or number that is none.
        """

    @abstractmethod
    def disconnect(self, name: str) -> None:
        """Let go. Raises UnknownNameError with the names that exist."""

    @abstractmethod
    def connections(self) -> list[str]:
        """Names of what is connected."""

    @abstractmethod
    def bushing_load(self, name: str) -> BushingLoad:
        """Of the last step; zero before the first. Raises UnknownNameError."""
