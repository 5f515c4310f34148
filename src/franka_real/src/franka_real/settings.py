"""Parameters of the real arm, read and checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import rospkg
import yaml

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.rate_limits import RateLimits
from franka_real.backend import ControlSettings
from franka_real.realtime_setup import RealtimeSettings
from hric_control.errors import CommandError, HricError, ParameterError
from hric_control.node import Node

ROBOTS = ("panda", "fr3")
MODELS = ("kdl", "libfranka")


@cache
def defaults() -> dict[str, Any]:
    """What config/franka_real.yaml says."""
    folder = Path(__file__).resolve().parents[2]
    if not (folder / "config").is_dir():  # installed
        folder = Path(rospkg.RosPack().get_path("franka_real"))
    values: dict[str, Any] = yaml.safe_load((folder / "config" / "franka_real.yaml").read_text(encoding="utf-8"))
    return values


def fr3_limits() -> RateLimits:
    """Limits of rate of the FR3's joints."""
    return RateLimits(**{name: tuple(values) for name, values in defaults()["fr3_rate_limits"].items()})


@dataclass(frozen=True)
class Settings:
    """Parameters of the robot node.

    Attributes:
        robot_ip: address of the control box.
        robot: panda or fr3.
        arm_id: prefix of joints and links.
        model: whose model controllers get: kdl (from robot_description) or libfranka (the arm's own).
        control, realtime: of libfranka's loops and of this process.
        collision: thresholds told at the start; None: left as they are.
        rotor_inertia: for controllers that check their gains, 7 floats [kg m^2].
        probe_timeout, connect_timeout, watchdog_timeout, watchdog_patience: [s of wall time].
    """

    robot_ip: str
    robot: str
    arm_id: str
    model: str
    control: ControlSettings
    realtime: RealtimeSettings
    collision: CollisionThresholds | None
    rotor_inertia: list[float]
    probe_timeout: float
    connect_timeout: float
    watchdog_timeout: float
    watchdog_patience: float


def read(node: Node) -> Settings:
    """All parameters.

    Raises:
        ParameterError: one is missing or wrong; says which and what would be valid.
    """
    rotor = _number(node, "rotor_inertia", minimum=0.0)
    return Settings(
        robot_ip=_text(node, "robot_ip"),
        robot=_one_of(node, "robot", ROBOTS, ROBOTS[0]),
        arm_id=_text(node, "arm_id", "panda"),
        model=_one_of(node, "model", MODELS, MODELS[0]),
        control=ControlSettings(
            rate_limiting=_flag(node, "rate_limiting"),
            cutoff_frequency=_number(node, "cutoff_frequency", above=0.0),
            cartesian_impedance=_one_of(node, "internal_controller", ("joint_impedance", "cartesian_impedance")) == "cartesian_impedance",
            enforce_realtime=_one_of(node, "realtime_config", ("enforce", "ignore")) == "enforce",
        ),
        realtime=RealtimeSettings(
            priority=int(_number(node, "realtime_priority", minimum=0.0, maximum=98.0)),
            lock_memory=_flag(node, "lock_memory"),
            switch_interval=_number(node, "switch_interval", above=0.0),
        ),
        collision=_collision(node),
        rotor_inertia=[rotor] * 7,
        probe_timeout=_number(node, "probe_timeout", above=0.0),
        connect_timeout=_number(node, "connect_timeout", above=0.0),
        watchdog_timeout=_number(node, "watchdog_timeout", minimum=0.0),
        watchdog_patience=_number(node, "watchdog_patience", above=0.0),
    )


def _value(node: Node, name: str) -> Any:
    return node.param(name, defaults()[name])


def _flag(node: Node, name: str) -> bool:
    value = _value(node, name)
    if not isinstance(value, bool):
        raise ParameterError(f"{node.resolve(name)} must be true or false; got {value!r}")
    return value


def _number(node: Node, name: str, *, minimum: float = -math.inf, above: float = -math.inf, maximum: float = math.inf) -> float:
    value = _value(node, name)
    good = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and minimum <= value <= maximum and value > above
    if not good:
        low = f"above {above:g}" if above > -math.inf else f"{minimum:g} or more"
        high = f" and at most {maximum:g}" if maximum < math.inf else ""
        raise ParameterError(f"{node.resolve(name)} must be a number, {low}{high}; got {value!r}")
    return float(value)


def _text(node: Node, name: str, default: str = "") -> str:
    value = node.param(name, default)
    if not isinstance(value, str) or not value:
        raise ParameterError(f"{node.resolve(name)} must be a text that is not empty; got {value!r}")
    return value


def _one_of(node: Node, name: str, valid: tuple[str, ...], default: str = "") -> str:
    value = node.param(name, default or defaults()[name])
    if value not in valid:
        raise ParameterError(f"{node.resolve(name)} must be one of {', '.join(valid)}; got {value!r}")
    return str(value)


def _collision(node: Node) -> CollisionThresholds | None:
    value, where = node.param("collision_config", defaults()["collision_config"]), node.resolve("collision_config")
    names = [item.name for item in fields(CollisionThresholds)]
    if value in ("", False, {}):
        return None
    if not isinstance(value, dict) or set(value) != set(names):
        raise ParameterError(f"{where} must be false (leave the arm's thresholds) or have the lists {', '.join(names)}; got {value!r}")
    try:
        return CollisionThresholds(**value)
    except (CommandError, TypeError, ValueError) as error:
        raise ParameterError(f"{where}: {error}") from None


def missing_wheel(error: ImportError, robot: str) -> HricError:
    """What to say when libfranka's bindings cannot be imported."""
    wheel = {"panda": "panda-python", "fr3": "pylibfranka"}[robot]
    return HricError(f"libfranka's binding for robot {robot!r} cannot be imported ({error}); {wheel} is installed by scripts/setup")
