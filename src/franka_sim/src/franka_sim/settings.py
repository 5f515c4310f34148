"""Parameters of the simulated arm, read and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import panda_description
from franka_hw_interface.kdl_chain import GRAVITY
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.impedance import JointImpedance, defaults, least_inertia, sustainable
from hric_control.errors import DescriptionError, ParameterError, UnknownNameError
from hric_control.joint_limits import KINDS, JointLimits, load_limits
from hric_control.limit_loading import DEFAULT_KINDS
from hric_control.node import Node

Q_START = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)
"""Franka's usual ready pose [rad]."""

POSES = 200
"""Legal poses over which the internal impedance is made stable."""


def numbers(value: Any, n: int, where: str) -> list[float]:
    """A list of n finite numbers.

    Raises:
        ParameterError: it is not one.
    """
    valid = isinstance(value, list | tuple) and all(isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in value)
    if not valid or len(value) != n:
        raise ParameterError(f"{where} must be a list of {n} finite numbers; got {value!r}")
    return [float(x) for x in value]


def read_arm_id(node: Node) -> str:
    """Prefix of joints and links."""
    value = node.param("arm_id", "panda")
    if not isinstance(value, str) or not value:
        raise ParameterError(f"{node.resolve('arm_id')} must be a non-empty string; got {value!r}")
    return value


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


def read_plant(node: Node, arm_id: str) -> dict[str, Any]:
    """Parameters of the plant; friction "identified" gets the published values if none are given."""
    value = node.param("plant", {})
    if not isinstance(value, Mapping):
        raise ParameterError(f"{node.resolve('plant')} must be a set of parameters; got {value!r}")
    config = dict(value)
    if config.get("friction") == "identified" and not config.get("friction_parameters"):
        config["friction_parameters"] = panda_description.friction_parameters(arm_id)
    return config


def read_limits(urdf_xml: str, root_node: Node, node: Node, arm_id: str, joint_names: Sequence[str]) -> list[JointLimits]:
    """Limits to enforce: description, over it `joint_limits/<joint>`, and Franka's own torque rate where neither gives one.

    `enforce_limits`: true (all but acceleration and jerk), false, or a list of kinds.
    """
    value, where = node.param("enforce_limits", True), node.resolve("enforce_limits")
    if isinstance(value, bool):
        kinds: Sequence[str] = DEFAULT_KINDS if value else ()
    elif isinstance(value, list | tuple) and all(kind in KINDS for kind in value):
        kinds = value
    else:
        raise ParameterError(f"{where} must be true, false or a list of {', '.join(KINDS)}; got {value!r}")
    limits = load_limits(urdf_xml, root_node, joint_names, tuple(kinds))
    if "effort_rate" not in kinds:
        return limits
    own = panda_description.joint_limits(arm_id)
    return [replace(limit, effort_rate=own[limit.name].effort_rate) if math.isinf(limit.effort_rate) else limit for limit in limits]


def read_rotor_inertia(plant: Mapping[str, Any], joint_names: Sequence[str]) -> list[float]:
    """Rotor inertia that the plant is given, in one of its three forms, n floats [kg m^2]; the plant itself refuses what is wrong."""
    value = plant.get("rotor_inertia", 0.1)
    if isinstance(value, Mapping):
        return [float(value.get(name, 0.0)) for name in joint_names]
    return [float(x) for x in value] if isinstance(value, list | tuple) else [float(value)] * len(joint_names)


def read_impedance(node: Node, urdf_xml: str, model: KdlFrankaModel, rotor_inertia: Sequence[float], time_step: float) -> JointImpedance:
    """Internal impedance: `internal_impedance/stiffness` and `/damping`, lowered where the loop could not carry them (said in the log)."""
    names, rule = model.joint_names, defaults()
    wanted = {}
    for gain in ("stiffness", "damping"):
        where = node.resolve(f"internal_impedance/{gain}")
        wanted[gain] = numbers(node.param(f"internal_impedance/{gain}", rule[gain]), len(names), where)
        if min(wanted[gain]) < 0.0:
            raise ParameterError(f"{where} must not be negative; got {wanted[gain]}")
    limits = load_limits(urdf_xml, None, names, ("position", "effort"))
    low, high = ([max(min(x, math.pi), -math.pi) for x in row] for row in zip(*((limit.lower, limit.upper) for limit in limits), strict=True))
    poses = np.random.default_rng(0).uniform(low, high, (POSES, len(names)))
    inertia = least_inertia(np.array([model.mass(q) for q in poses]), rotor_inertia)
    stiffness, damping = sustainable(wanted["stiffness"], wanted["damping"], inertia, time_step)
    if stiffness != wanted["stiffness"] or max(d / w if w else 1.0 for d, w in zip(damping, wanted["damping"], strict=True)) < 0.5:
        given = ", ".join(f"{k:.0f}/{d:.1f}" for k, d in zip(stiffness, damping, strict=True))
        node.log_info(f"internal impedance lowered to what {time_step:g} s and so little rotor inertia carry, K/D per joint: {given}")
    return JointImpedance(tuple(stiffness), tuple(damping), tuple(limit.effort for limit in limits))
