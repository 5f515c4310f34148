"""Parameters that are common to the plants of all physics engines."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_control.plant import DEFAULT_PLANT as DEFAULT_PLANT
from hric_control.plants.surfaces import SurfaceRule
from hric_core.errors import ParameterError
from hric_core.geometry import MassProperties, Vector, judge, tensor
from hric_core.parameters import (
    Settings,
    choice,
    flag,
    listing,
    mapping,
    number,
    numbers,
    per_joint,
    refused,
    section,
    text,
    whole,
)
from hric_core.urdf import Robot

ROTOR_INERTIA = 0.1
"""Rotor inertia of a joint whose description states none [kg m^2]: as in MuJoCo's menagerie; project default."""
LARGEST_GRAVITY = 10.0
"""Largest valid magnitude of gravity [m/s^2]; Earth's is at most 9.83, at the poles (WGS 84)."""


def _gravity(vector: Vector) -> Vector:
    """Refuse gravity that points upwards or is larger than LARGEST_GRAVITY."""
    if vector[2] > 0.0 or math.hypot(*vector) > LARGEST_GRAVITY:
        raise ValueError
    return vector


GRAVITY: Any = numbers(
    3, (0.0, 0.0, -9.81), made=_gravity, name="gravity", unit="m/s^2", text="gravity in the world frame, z up"
)
GRAVITY.accepts = f"three finite numbers, {LARGEST_GRAVITY:g} at most in size and the third not above 0"


@dataclass(frozen=True)
class Payload(Settings):
    """Payload that the simulated robot carries; its control box knows only the load of `franka_control/set_load`."""

    mass: float = number(0.0, minimum=0.0, maximum=50.0, unit="kg", text="mass of the payload; 0: none")
    com: Vector = numbers(
        3, (0.0, 0.0, 0.0), minimum=-1.0, maximum=1.0, unit="m", text="centre of mass in the link frame"
    )
    inertia: tuple[float, ...] = numbers(
        6, (0.0,) * 6, unit="kg m^2", text="ixx, ixy, ixz, iyy, iyz, izz about the centre of mass"
    )
    link: str = text("", text="link with the payload; empty: the child of the last actuated joint")

    def check(self, where: str) -> None:
        """Refuse values without a mass."""
        if self.mass == 0.0 and (any(self.com) or any(self.inertia) or self.link):
            raise ParameterError(f"{where.rstrip('/')} has no mass; valid: with {where}mass above 0 [kg]")
        verdict = judge(tensor(*self.inertia))  # that of a point or a rod has zeros
        if min(verdict.moments[0], verdict.triangle_margin) < -1e-9:
            valid = "that of a body: no negative principal moment, and none above the sum of the other two"
            raise refused(f"{where}inertia", list(self.inertia), valid)


def carried(payloads: Sequence[Payload], tree: Robot, joints: Sequence[str]) -> dict[str, MassProperties]:
    """Return the mass properties of payloads by link, in its frame; several payloads of one link are added.

    Args:
        payloads: the payloads; one without mass is left out.
        tree: description of the robot.
        joints: actuated joints.

    Raises:
        UnknownNameError: the description has no such link.
    """
    loads: dict[str, MassProperties] = {}
    for payload in payloads:
        if payload.mass:
            link = payload.link or tree.joints[joints[-1]].child
            tree.check_link(link)
            added = MassProperties(payload.mass, np.array(payload.com), tensor(*payload.inertia))
            loads[link] = added + loads.get(link, MassProperties())
    return loads


@dataclass(frozen=True)
class PlantConfig(Settings):
    """Parameters of a plant; a plant with further parameters derives a class from this one."""

    time_step: float = number(
        0.001, above=0.0, maximum=0.1, unit="s", text="time step of the physics engine and of the control loop"
    )
    integrator: str = choice("accurate", "semi_implicit", text="integration method")
    rotor_inertia: tuple[float, ...] = per_joint(
        number(minimum=0.0, unit="kg m^2"),
        ROTOR_INERTIA,
        others=0.0,
        default_text=f"the description's, else `{ROTOR_INERTIA}`",
        text="rotor inertia, seen at the joint; 0 for joints that are missing in a mapping",
    )
    friction: str = choice("none", "coulomb", "identified", text="joint friction")
    friction_parameters: Mapping[str, object] = mapping(
        default={},
        unit="N m, s/rad, rad/s",
        text="parameters of friction `identified`: lists `phi1`, `phi2`, `phi3` and optionally `breakaway` [N m], or a "
        "mapping of these by joint",
    )
    passive_joints: str = choice("free", "locked", text="behaviour of joints without transmission")
    collision: bool = flag(True, text="`false`: the robot collides with nothing")
    self_collision: bool = flag(True, text="`false`: links of the robot do not collide with each other")
    collision_masks: str = text(
        "",
        valid="a path or package://",
        default_text="`package://hric_control/config/collision_masks.yaml`",
        text="file with pairs of link name patterns that do not collide, path or package://",
    )
    contact_stiffness: float = number(
        75000.0, above=0.0, unit="N/m", text="stiffness of penalty contact for objects that set none"
    )
    surfaces: tuple[SurfaceRule, ...] = listing(
        section(SurfaceRule),
        default=(),
        unit="N/m, N s/m",
        text="rules for contact surfaces of single links, see pybullet_ros_control, Surfaces",
    )
    world: str = text(
        "", valid="a path or package://", text="world file, path or package://; see pybullet_ros_control, Worlds"
    )
    gravity: Vector = GRAVITY
    payload: tuple[Payload, ...] = listing(
        section(Payload),
        default=(),
        single=True,
        text="a payload with the keys below, or a list of payloads, also of several links",
    )
    gui: bool = flag(False, text="`true`: open the window of the engine; needs a display")
    half_step_readout: bool = flag(
        True,
        text="semi-implicit integrator: return the position at the instant of the velocity, q - dt dq/2",
    )
    seed: int = whole(0, text="seed, recorded with the run; this plant uses no random numbers")


@dataclass(frozen=True)
class WindowlessConfig(PlantConfig):
    """Parameters of a plant without a window of its own, which would slow down the loop; rviz displays the robot."""

    gui: bool = flag(False, text="must be false: this plant has no window")

    def check(self, where: str) -> None:
        """Raise ParameterError if a window is requested."""
        if self.gui:
            raise refused(f"{where}gui", True, "false: this plant has no window of its own; look at the robot in rviz")


def rotor_inertia(plant: Mapping[str, object], joint_names: Sequence[str], robot: Robot) -> tuple[float, ...]:
    """Return the rotor inertia of the joints, n floats [kg m^2]. Raises ParameterError.

    Args:
        plant: parameters of the plant; `rotor_inertia` has priority over the description.
        joint_names: the actuated joints.
        robot: description of the robot.
    """
    if "rotor_inertia" in plant:
        return PlantConfig.of({"rotor_inertia": plant["rotor_inertia"]}, "plant/", joint_names).rotor_inertia
    stated = [robot.joints[name].rotor_inertia for name in joint_names if name in robot.joints]
    return tuple(ROTOR_INERTIA if value is None else value for value in stated)
