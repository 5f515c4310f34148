"""Parameters of the control box, with their defaults from config/control_box.yaml."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cache, partial
from pathlib import Path
from typing import Any

import yaml

from franka_hw_interface.limits import FrankaLimits, franka_limits
from hric_control.errors import HricError, ParameterError

Vector = tuple[float, ...]


@cache
def read_config(name: str) -> dict[str, Any]:
    """What config/<name>.yaml of this package says."""
    for folder in (Path(__file__).resolve().parents[3], *_installed()):
        path = folder / "config" / f"{name}.yaml"
        if path.is_file():
            values: dict[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
            return values
    raise HricError(f"franka_sim: config/{name}.yaml is not found")


def _installed() -> list[Path]:
    import rospkg

    try:
        return [Path(rospkg.RosPack().get_path("franka_sim"))]
    except rospkg.ResourceNotFound:
        return []


def _default(name: str) -> Any:
    found = read_config("control_box")[name]
    return tuple(map(float, found)) if isinstance(found, list) else found


@dataclass(frozen=True)
class CollisionBehavior:
    """Thresholds of contact (lower) and collision (upper), in the order of libfranka's setCollisionBehavior.

    Attributes:
        *_torque_*: of the external joint torque, 7 floats [N m].
        *_force_*: of the external wrench on the stiffness frame, 3 forces [N] and 3 moments [N m].
        *_acceleration: while the desired motion accelerates; *_nominal: else.
    """

    lower_torque_acceleration: Vector
    upper_torque_acceleration: Vector
    lower_torque_nominal: Vector
    upper_torque_nominal: Vector
    lower_force_acceleration: Vector
    upper_force_acceleration: Vector
    lower_force_nominal: Vector
    upper_force_nominal: Vector

    def __post_init__(self) -> None:
        for item in fields(self):
            values, n = tuple(map(float, getattr(self, item.name))), 7 if "torque" in item.name else 6
            if len(values) != n or not all(math.isfinite(x) and x >= 0.0 for x in values):
                raise ParameterError(f"collision behaviour: {item.name} must be {n} finite numbers, none negative; got {list(values)}")
            object.__setattr__(self, item.name, values)


def _collision_behavior() -> CollisionBehavior:
    return CollisionBehavior(**read_config("control_box")["collision_behavior"])


@dataclass(frozen=True)
class BoxConfig:
    """Parameters of the control box; config/control_box.yaml explains those that stand there.

    Attributes:
        limits: of joints and end effector.
        friction: phi1 [N m], phi2 [s/rad], phi3 [rad/s] by joint name, as `panda_description.friction_parameters()` gives them: what the box
            compensates and expects; None: no friction.
        rotor_inertia: 7 floats [kg m^2].
        time_step: [s].
        reflexes: whether the arm protects itself; without them commands are limited where they can be, and nothing ends a motion but NaN.
        max_lost_packets: in a row, or None: as many as come.
        settings_while_moving: whether load, frames and impedances may be set while a motion runs; the Franka Control Interface refuses it.
        The others: see the YAML.
    """

    limits: FrankaLimits = field(default_factory=franka_limits)
    friction: Mapping[str, Mapping[str, float]] | None = None
    rotor_inertia: Vector = field(default_factory=partial(_default, "rotor_inertia"))
    time_step: float = field(default_factory=partial(_default, "time_step"))
    reflexes: bool = True
    max_lost_packets: int | None = field(default_factory=partial(_default, "max_lost_packets"))
    settings_while_moving: bool = False
    success_window: int = field(default_factory=partial(_default, "success_window"))
    torque_rate_tolerance: float = field(default_factory=partial(_default, "torque_rate_tolerance"))
    position_margin: float = field(default_factory=partial(_default, "position_margin"))
    start_tolerance: float = field(default_factory=partial(_default, "start_tolerance"))
    external_torque_cutoff: float = field(default_factory=partial(_default, "external_torque_cutoff"))
    least_singular_value: float = field(default_factory=partial(_default, "least_singular_value"))
    self_collision_margin: float = field(default_factory=partial(_default, "self_collision_margin"))
    reach: Vector = field(default_factory=partial(_default, "reach"))
    stop_deceleration: float = field(default_factory=partial(_default, "stop_deceleration"))
    collision_behavior: CollisionBehavior = field(default_factory=_collision_behavior)

    def __post_init__(self) -> None:
        for name in ("time_step", "external_torque_cutoff", "stop_deceleration", "least_singular_value"):
            _check(name, getattr(self, name), lambda x: x > 0.0, "a positive number")
        for name in ("torque_rate_tolerance", "position_margin", "start_tolerance", "self_collision_margin"):
            _check(name, getattr(self, name), lambda x: x >= 0.0, "a number, not negative")
        for name in ("success_window",) if self.max_lost_packets is None else ("success_window", "max_lost_packets"):
            _check(name, getattr(self, name), lambda x: x == int(x) and x > 0, "a positive whole number")
        for name in ("rotor_inertia", "reach"):
            values = tuple(map(float, getattr(self, name)))
            if len(values) != 7 or not all(math.isfinite(x) and x >= 0.0 for x in values):
                raise ParameterError(f"control box: {name} must be 7 finite numbers, none negative; got {list(values)}")
            object.__setattr__(self, name, values)


def _check(name: str, value: Any, valid: Callable[[float], bool], what: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or not valid(value):
        raise ParameterError(f"control box: {name} must be {what}; got {value!r}")
