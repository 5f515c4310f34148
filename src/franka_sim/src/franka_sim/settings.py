"""Parameters of the simulated arm, read and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

from franka_hw_interface.arm_parameters import numbers, read_arm_id, read_limits
from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.kdl_chain import GRAVITY
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.rate_limits import RateLimits
from franka_sim.box.config import BoxConfig, CollisionBehavior
from franka_sim.box.internal_impedance import JointImpedanceLaw
from franka_sim.impedance import defaults
from franka_sim.realism import IDEAL, Realism, parse
from hric_control.errors import CommandError, DescriptionError, ParameterError, UnknownNameError
from hric_control.node import Node

Q_START = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)
"""Franka's usual ready pose [rad]."""

__all__ = ["Q_START", "make_model", "numbers", "read_arm_id", "read_limits"]


def make_model(node: Node, urdf_xml: str, arm_id: str, plant: Mapping[str, Any]) -> KdlFrankaModel:
    """What the arm knows of itself; it senses the direction of the plant's gravity, as a real one its mounting."""
    gravity = numbers(plant.get("gravity", list(GRAVITY)), 3, node.resolve("plant/gravity"))
    try:
        model = KdlFrankaModel(urdf_xml, arm_id, gravity_world=gravity)
    except UnknownNameError as error:
        raise ParameterError(f"{node.resolve('arm_id')} is {arm_id!r}, but {error}") from None
    expected = tuple(f"{arm_id}_joint{i}" for i in range(1, 8))
    if model.joint_names != expected:
        raise DescriptionError(f"the joints are {', '.join(model.joint_names)}; those of a Franka arm {arm_id} are {', '.join(expected)}")
    return model


def read_q_start(node: Node, joint_names: Sequence[str]) -> list[float]:
    """Start pose, a list in the order of the joints or a mapping (joints not named start as usual) [rad]."""
    value, where = node.param("q_start", list(Q_START)), node.resolve("q_start")
    if isinstance(value, Mapping):
        for name in value:
            if name not in joint_names:
                raise UnknownNameError("joint", name, joint_names, where)
        value = [value.get(name, usual) for name, usual in zip(joint_names, Q_START, strict=True)]
    return numbers(value, len(joint_names), where)


def read_realism(node: Node) -> Realism:
    """How far the arm is from what its box believes: name of a preset, or a mapping with values that differ from one."""
    return parse(node.param("realism", IDEAL), node.resolve("realism"))


def read_plant(node: Node, arm_id: str, realism: Realism) -> dict[str, Any]:
    """Parameters of the plant, with the friction of `realism` where they name none."""
    value = node.param("plant", {})
    if not isinstance(value, Mapping):
        raise ParameterError(f"{node.resolve('plant')} must be a set of parameters; got {value!r}")
    return realism.with_friction(value, arm_id)


def read_rotor_inertia(plant: Mapping[str, Any], joint_names: Sequence[str]) -> list[float]:
    """Rotor inertia that the plant is given, in one of its three forms, n floats [kg m^2]; the plant itself refuses what is wrong."""
    value = plant.get("rotor_inertia", 0.1)
    if isinstance(value, Mapping):
        return [float(value.get(name, 0.0)) for name in joint_names]
    return [float(x) for x in value] if isinstance(value, list | tuple) else [float(value)] * len(joint_names)


def read_box(node: Node, plant: Mapping[str, Any], joint_names: Sequence[str], time_step: float, realism: Realism) -> BoxConfig:
    """Parameters of the control box: `reflexes`, `settings_while_moving`, `collision_config`.

    It knows the plant's rotor inertia, and its friction as far as `realism` says.
    """
    friction = realism.known_friction(plant, joint_names)
    thresholds = _collision(node)
    config = BoxConfig(
        friction=friction,
        rotor_inertia=tuple(read_rotor_inertia(plant, joint_names)),
        time_step=time_step,
        reflexes=_flag(node, "reflexes", True),
        settings_while_moving=_flag(node, "settings_while_moving", False),
    )
    return config if thresholds is None else replace(config, collision_behavior=thresholds)


def _flag(node: Node, name: str, default: bool) -> bool:
    value = node.param(name, default)
    if not isinstance(value, bool):
        raise ParameterError(f"{node.resolve(name)} must be true or false; got {value!r}")
    return value


def _collision(node: Node) -> CollisionBehavior | None:
    value, where = node.param("collision_config", False), node.resolve("collision_config")
    names = [item.name for item in fields(CollisionThresholds)]
    if value in ("", False, {}):
        return None
    if not isinstance(value, Mapping) or set(value) != set(names):
        raise ParameterError(f"{where} must be false (the defaults) or have the lists {', '.join(names)}; got {value!r}")
    try:
        return CollisionBehavior(*(tuple(row) for row in CollisionThresholds(**value).lists()))
    except (CommandError, TypeError) as error:
        raise ParameterError(f"{where}: {error}") from None


def read_rate_limits(node: Node) -> RateLimits | None:
    """Limits of rate that libfranka's control loops would keep joint positions and velocities to, unless `rate_limiting` is false."""
    if not _flag(node, "rate_limiting", True):
        return None
    limits = franka_limits().with_margins()
    return RateLimits(limits.effort_rate, limits.velocity, limits.acceleration, limits.jerk)


def read_internal_impedance(node: Node, law: JointImpedanceLaw) -> None:
    """Internal joint impedance: `internal_impedance/stiffness`; gains lowered to what the loop carries are said in the log."""
    given, where = node.param("internal_impedance", {}), node.resolve("internal_impedance")
    if not isinstance(given, Mapping) or set(given) - {"stiffness"}:
        raise ParameterError(f"{where} holds `stiffness`, 7 numbers [N m/rad], and nothing else; got {given!r}")
    wanted = numbers(given.get("stiffness", defaults()["stiffness"]), 7, f"{where}/stiffness")
    try:
        law.set_stiffness(wanted)
    except CommandError as error:
        raise ParameterError(f"{where}/stiffness: {error}") from None
    if list(law.stiffness) != wanted:
        lowered = ", ".join(f"{k:.0f}/{d:.1f}" for k, d in zip(law.stiffness, law.damping, strict=True))
        node.log_info(f"internal impedance lowered to what the time step and so little rotor inertia carry, K/D per joint: {lowered}")
