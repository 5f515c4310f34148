"""The parameters that all plants share: defaults, and what is valid."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from hric_control.errors import ParameterError, UnknownNameError
from hric_control.plant import check_config
from hric_control.plants.surfaces import SurfaceRule, read_rules

DEFAULTS: dict[str, Any] = {
    "time_step": 0.001,
    "integrator": "accurate",
    "rotor_inertia": 0.1,
    "friction": "none",
    "friction_parameters": {},
    "self_collision": True,
    "collision": True,
    "collision_masks": "",
    "contact_stiffness": 75000.0,
    "surfaces": [],
    "world": "",
    "gui": False,
    "gravity": [0.0, 0.0, -9.81],
    "half_step_readout": True,
    "passive_joints": "free",
    "seed": 0,
}
"""Keys and defaults; the INTERFACE.md of a plant says what they mean."""

INTEGRATORS = ("accurate", "semi_implicit")
FRICTIONS = ("none", "coulomb", "identified")
PASSIVE = ("free", "locked")


@dataclass(frozen=True)
class PlantConfig:
    """Checked parameters; the keys of DEFAULTS, with rotor inertia per joint. A plant with more of them adds fields, `defaults` and `check`."""

    defaults: ClassVar[Mapping[str, Any]] = DEFAULTS

    time_step: float
    integrator: str
    rotor_inertia: tuple[float, ...]
    friction: str
    friction_parameters: Mapping[str, Any]
    self_collision: bool
    collision: bool
    collision_masks: str
    contact_stiffness: float
    surfaces: tuple[SurfaceRule, ...]
    world: str
    gui: bool
    gravity: tuple[float, ...]
    half_step_readout: bool
    passive_joints: str
    seed: int

    @classmethod
    def from_parameters(cls, parameters: Mapping[str, Any], joint_names: Sequence[str]) -> Self:
        """Check the parameters.

        Raises:
            HricError: unknown key, wrong type or value; the message gives the key and what is valid.
        """
        values = check_config(parameters, cls.defaults, "plant")
        cls.check(values, joint_names)
        return cls(**values)

    @classmethod
    def check(cls, values: dict[str, Any], joint_names: Sequence[str]) -> None:
        """Check the values and bring them into their final types, in place. Raises HricError."""
        for key in ("self_collision", "collision", "gui", "half_step_readout"):
            if not isinstance(values[key], bool):
                raise ParameterError(f"plant/{key} must be true or false; got {values[key]!r}")
        for key, valid in (("integrator", INTEGRATORS), ("friction", FRICTIONS), ("passive_joints", PASSIVE)):
            choice(values[key], valid, f"plant/{key}")
        for key in ("time_step", "contact_stiffness"):
            values[key] = number(values[key], f"plant/{key}", positive=True)
        values["surfaces"] = read_rules(values["surfaces"], values["contact_stiffness"], "plant/surfaces")
        if not isinstance(values["gravity"], (list, tuple)) or len(values["gravity"]) != 3:
            raise ParameterError(f"plant/gravity must be three numbers [m/s^2]; got {values['gravity']!r}")
        values["gravity"] = tuple(number(g, "plant/gravity") for g in values["gravity"])
        values["rotor_inertia"] = rotor_inertia(values["rotor_inertia"], joint_names)
        for key in ("world", "collision_masks"):
            if not isinstance(values[key], (str, Path)):
                raise ParameterError(f"plant/{key} must be a file name; got {values[key]!r}")
            values[key] = str(values[key])
        if isinstance(values["seed"], bool) or not isinstance(values["seed"], int):
            raise ParameterError(f"plant/seed must be a whole number; got {values['seed']!r}")


def choice(value: Any, valid: Sequence[str], where: str) -> None:
    """Refuse what is not one of the valid words. Raises ParameterError."""
    if value not in valid:
        raise ParameterError(f"{where} must be one of {', '.join(valid)}; got {value!r}")


def number(value: Any, where: str, positive: bool = False) -> float:
    """A finite (positive) number. Raises ParameterError."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or (positive and value <= 0.0):
        raise ParameterError(f"{where} must be a {'positive ' if positive else ''}number; got {value!r}")
    return float(value)


def rotor_inertia(value: Any, joint_names: Sequence[str]) -> tuple[float, ...]:
    """Rotor inertia per joint [kg m^2] from one number for all, a list in the order of the joints, or a mapping by joint (others: 0).

    Raises:
        ParameterError: not a number, negative, wrong length.
        UnknownNameError: a joint that does not exist.
    """
    if isinstance(value, Mapping):
        for joint in value:
            if joint not in joint_names:
                raise UnknownNameError("joint", joint, joint_names, "plant/rotor_inertia")
        value = [value.get(joint, 0.0) for joint in joint_names]
    elif not isinstance(value, (list, tuple)):
        value = [value] * len(joint_names)
    if len(value) != len(joint_names):
        raise ParameterError(f"plant/rotor_inertia has {len(value)} values for {len(joint_names)} joints ({', '.join(joint_names)})")
    numbers = tuple(number(v, "plant/rotor_inertia") for v in value)
    if min(numbers) < 0.0:
        raise ParameterError(f"plant/rotor_inertia must not be negative; got {list(numbers)}")
    return numbers
