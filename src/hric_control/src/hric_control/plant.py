"""Interface of a plant: a robot and its surroundings, simulated by a physics engine.

Engines are plugins, which are found by name at start-up; this module imports none of them."""

import importlib.util
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

REPLACEMENT = "" if importlib.util.find_spec("pybullet") else "mujoco_ros_control/MujocoPlant"
"""Plugin of the default plant where PyBullet is not installed (Debian 13); empty where it is."""
DEFAULT_PLANT = REPLACEMENT or "pybullet_ros_control/PyBulletPlant"
"""Plugin of the default plant."""


@dataclass(frozen=True)
class Load:
    """Physical payload fixed to a link.

    Attributes:
        mass: mass [kg].
        com: centre of mass in the link frame, 3 floats [m].
        inertia: inertia tensor about the centre of mass, in the axes of the link frame, 9 floats row by row [kg m^2].
    """

    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = (0.0,) * 9


@dataclass(frozen=True)
class Surface:
    """Contact properties of a body's surface; the laws are those of `hric_control.plants.contact_law`.

    Attributes:
        stiffness: stiffness of penalty contact [N/m], with an exponent n [N/m^n]; None: rigid contact of the engine.
        damping: damping of penalty contact [N s/m].
        friction: friction coefficient [1]; for two bodies in contact, the product of both is used.
        exponent: exponent n of the penetration [1].
        dissipation: dissipation of Hunt-Crossley contact [s/m].
        relaxing: stiffness of the relaxing spring of a viscoelastic surface [N/m].
        relaxation_time: relaxation time of a viscoelastic surface [s]; None: the surface does not relax.
    """

    stiffness: float | None = None
    damping: float = 0.0
    friction: float = 0.5
    exponent: float = 1.0
    dissipation: float = 0.0
    relaxing: float = 0.0
    relaxation_time: float | None = None


@dataclass(frozen=True)
class Contact:
    """Contact point between two bodies.

    Attributes:
        body_a, body_b: names "model::link".
        position: contact point in the world frame, 3 floats [m].
        normal: unit vector from b to a in the world frame, 3 floats.
        depth: penetration depth, positive if the bodies overlap [m].
        force: normal force on a along `normal` [N]: the maximum within the step if it is known, else the force at its
            end.
        kind: "penalty": force of one of the laws of `Surface`, comparable with a sensor's reading; "rigid": force that
            stops the bodies within one step, which in an impact is far above the force of an elastic contact.
        impulse: normal force integrated over the step [N s]; for penalty contact it is not `force` times the step.
        closing: approach speed along the normal at the start of the step [m/s]; None for rigid contact, which engines
            report when the approach has already been stopped.
        energy: largest work that the bodies have done on the contact since it began [J]; None for rigid contact.
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
    energy: float | None = None


class JointReaction(NamedTuple):
    """Load that the parent link exerts on the child link through a joint, including the load of the joint's drive.

    Attributes:
        joint: joint name in the description.
        link: name of the child link.
        position: origin of the child link, to which the torque refers, in the world frame, 3 floats [m].
        force, torque: load on the child link in the world frame, 3 floats each [N], [N m].
    """

    joint: str
    link: str
    position: tuple[float, float, float]
    force: tuple[float, float, float]
    torque: tuple[float, float, float]


@dataclass(frozen=True)
class Bushing:
    """Spring and damper between two bodies, e.g. a hand around a handle; it slips if its limits are exceeded.

    Attributes:
        body_a, body_b: "link" of the robot, or "model::link".
        T_a_grip, T_b_grip: pose of the grip frame in body a and in body b, shape (4, 4); the spring is relaxed if both
            grip frames coincide.
        stiffness, damping: translational stiffness and damping between the grip frames [N/m], [N s/m].
        rotational_stiffness, rotational_damping: the rotational ones [N m/rad], [N m s/rad].
        force_limit, torque_limit: force and torque at which the bushing slips [N], [N m].
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
        force, torque: load on body a at `point`, in the world frame, 3 floats each [N], [N m]; the load on body b is
            the opposite one.
        point: origin of body b's grip frame, in the world frame, 3 floats [m].
        stretch: distance between the origins of both grip frames [m].
        slipped: accumulated slip since the connection was made [m].
        turned: accumulated rotational slip since the connection was made [rad].
    """

    force: tuple[float, float, float]
    torque: tuple[float, float, float]
    point: tuple[float, float, float]
    stretch: float
    slipped: float
    turned: float


class Mode(Enum):
    """Command mode of a joint: the meaning of the commanded value, or a locked brake."""

    EFFORT = "effort"
    VELOCITY = "velocity"
    POSITION = "position"
    BRAKE = "brake"


class Plant(ABC):
    """Simulated physics of a robot and its surroundings: joints, friction, rotor inertia, contact.

    It has no controllers, no limits on commands, and no ROS. Features that only some engines offer are in the derived
    classes `DrivenPlant`, `ReactingPlant` and `Articulated`.

    Constructed by the RobotHW as `PlantClass(urdf_xml, joint_names, config)`:
        urdf_xml: robot description (URDF with xacro expanded).
        joint_names: the actuated joints, in the order of all vectors of this class.
        config: the parameters `plant/...` (time_step, rotor_inertia, friction, world, gui, ...); unknown ones are
            refused.
    """

    joint_names: tuple[str, ...]
    time_step: float
    """Time step of the simulation [s]."""
    integrator: str = "accurate"
    """Integrator in use: "accurate" or "semi_implicit"."""
    gravity: Sequence[float] = (0.0, 0.0, -9.81)
    """Gravity in the world frame, 3 floats [m/s^2]."""

    @abstractmethod
    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Set the robot's joint positions q and velocities dq (zero by default), and reset the world to its start.

        Applied wrenches and contacts are cleared. q [rad or m], dq [rad/s or m/s]: n floats."""

    @abstractmethod
    def set_configuration(self, q: Sequence[float]) -> None:
        """Set the robot's joint positions, n floats [rad or m], with zero velocity; the world is not changed."""

    @abstractmethod
    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Write the joint state at the measuring instant into the lists, in place.

        q: joint positions [rad or m]; a semi-implicit engine returns q - dt*dq/2, the position at the instant of dq.
        dq: joint velocities [rad/s or m/s].
        tau: joint efforts in the last step as an arm's torque sensors measure them, on the link's side of the rotor
            [N m or N]: motor effort minus rotor inertia times acceleration. Friction acts behind the sensor, so it is
            not subtracted.
        """

    @abstractmethod
    def motor_effort(self) -> list[float]:
        """Return the motor efforts in the last step, n floats [N m]: those of `apply`, or of a stiff drive or brake."""

    @abstractmethod
    def engine_state(self) -> tuple[list[float], list[float]]:
        """Return joint positions and velocities as the engine has them, without correction to the measuring instant."""

    @abstractmethod
    def apply(self, tau: Sequence[float]) -> None:
        """Set the joint efforts for the next step, n floats [N m]; must be called before every step."""

    @abstractmethod
    def step(self) -> None:
        """Advance the simulation by `time_step`."""

    @abstractmethod
    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock (True) or release (False) the brake of each joint; a locked joint ignores efforts."""

    @abstractmethod
    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Replace the payload of a link, by default the child of the last actuated joint; `load` None removes it.

        `load` and `link` None: remove all payloads. Joint positions and velocities are not changed."""

    @abstractmethod
    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Apply a wrench to a body, "link" or "model::link", for `duration` seconds (negative: until cleared).

        `force` [N] and `torque` [N m] are in the world frame; `point` is the point of application in the link frame
        [m].
        """

    @abstractmethod
    def clear_wrenches(self, body: str | None = None) -> None:
        """Remove the applied wrenches on one body, or on all bodies."""

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
        """Add a model to the world.

        Args:
            name: name of the model, unique in the world.
            urdf_xml: description of the model (URDF with xacro expanded).
            T_world_model: pose of the model's root link, shape (4, 4).
            fixed: True to fix the root link to the world.
            surfaces: surface by link name; other links have rigid contact. Rules of the world file and of the plant's
                parameters override these surfaces.

        Raises:
            HricError: the name is taken, the pose is not a transform, the URDF is invalid, or a surface is given for a
                link that does not exist.
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
        """Remove a spawned model. Raises UnknownNameError if there is none of this name."""

    @abstractmethod
    def model_names(self) -> list[str]:
        """Return the names of the spawned models, without the robot."""

    @abstractmethod
    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return pose and twist of a body, "link" or "model::link".

        The pose is T_world_link, shape (4, 4). The twist is that of the link frame's origin in the world frame, linear
        [m/s], then angular [rad/s], shape (6,)."""

    def base_link(self, model: str) -> str:
        """Return the name of a model's root link; for a simple shape of the world file it is "link"."""
        return "link"

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest penalty contact force [N] since the last call, by pair of bodies as in `contacts`."""
        return {}

    @abstractmethod
    def mass_matrix(self) -> FloatArray:
        """Return the engine's joint-space mass matrix at the present positions, for checks, shape (n, n) [kg m^2].

        It does not include the rotor inertia; it includes the effect of joints that mimic the actuated ones."""

    def close(self) -> None:  # noqa: B027  (an engine without resources needs no override)
        """Release the resources of the engine."""


class DrivenPlant(Plant):
    """Plant whose joints can follow velocity or position commands by stiff drives, in addition to efforts."""

    @abstractmethod
    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the command mode of each joint: the meaning of the values passed to `apply` from now on."""


class ReactingPlant(Plant):
    """Plant that can report the forces and torques transmitted by its joints."""

    @abstractmethod
    def joint_reactions(self) -> list[JointReaction]:
        """Return the loads transmitted by the robot's moving joints in the last step; empty before the first step."""


class Articulated(Plant):
    """Plant with articulated models, whose joints can be read, set and driven, and whose bodies can be connected.

    Names and connections remain valid after `reset`, `spawn`, `set_load`, and `delete` of another model; the
    connections of a deleted model are removed. Joints of spawned models have the viscous damping of their description,
    its Coulomb friction if the plant's parameter `friction` is "coulomb", and stops by `plants.StopLaw`.
    """

    @abstractmethod
    def model_joints(self, model: str) -> tuple[str, ...]:
        """Return the names of a spawned model's moving joints, parents before children.

        This is the order of the joint vectors in the other methods.

        Raises:
            UnknownNameError: there is no such model.
        """

    @abstractmethod
    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """Write the joint positions and velocities of a spawned model into the lists, in place.

        q [rad or m], dq [rad/s or m/s]: state at the measuring instant, as in `read_state`."""

    @abstractmethod
    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Set the joint positions and velocities (zero by default) of a spawned model.

        `reset` restores the pose at which the model was spawned, and the joint state that was set last.

        Args:
            model: name of the model.
            q: joint positions [rad or m].
            dq: joint velocities [rad/s or m/s].

        Raises:
            CommandError: q or dq does not have one finite number per joint.
        """

    @abstractmethod
    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Set the joint efforts of a spawned model, `tau` [N m or N], from the next step until the next call.

        `reset` sets them to zero.

        Raises:
            CommandError: there is not one effort per joint.
        """

    @abstractmethod
    def connect(self, name: str, bushing: Bushing) -> None:
        """Connect two bodies by a bushing (spring and damper) from the next step on; `name`: name of the connection.

        There is no contact between the connected links, nor between them and each other's neighbours.

        Raises:
            HricError: the name is taken, a body does not exist, both bodies are the same, or a transform or number is
                invalid.
        """

    @abstractmethod
    def disconnect(self, name: str) -> None:
        """Remove a connection between two bodies. Raises UnknownNameError if there is none of this name."""

    @abstractmethod
    def connections(self) -> list[str]:
        """Return the names of the present connections between bodies."""

    @abstractmethod
    def bushing_load(self, name: str) -> BushingLoad:
        """Return the load of a connection in the last step; zero before the first step. Raises UnknownNameError."""
