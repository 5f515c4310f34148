"""Paths of this package's xacro and YAML files, in a source tree or installed, and its limits and friction."""

import importlib.util
import logging
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hric_core.parameters import package_yaml

LOG = logging.getLogger("hric.panda_description")
PACKAGE = "panda_description"
HAND_LINKS = {"hand", "leftfinger", "rightfinger"}


@cache
def share() -> Path:
    """Return the folder that contains config/ and urdf/."""
    source = Path(__file__).resolve().parents[2]
    return source if (source / "urdf").is_dir() else Path(find_package(PACKAGE))


def find_package(name: str) -> str:
    """Return the folder of any ROS package on ROS_PACKAGE_PATH; raises rospkg.ResourceNotFound."""
    import rospkg  # only an installed tree or a foreign $(find) needs it, and it is slow to import

    return str(rospkg.RosPack().get_path(name))


def config(name: str) -> dict[str, Any]:
    """Return the content of config/<name>.yaml; it is shared, so do not change it."""
    return package_yaml(__file__, name)


@cache
def folder_uri() -> str:
    """Return the URI (file:///...) of the meshes' folder; empty, with one warning, if package or mesh is missing."""
    folder, missing = _look()
    if missing:
        LOG.warning("no visual meshes of the Panda (%s); the collision primitives are drawn instead", missing)
        return ""
    return folder.as_uri()


def _look() -> tuple[Path, str]:
    """Return the folder of the meshes, and a text about missing ones (empty if none)."""
    source = config("meshes")
    spec = importlib.util.find_spec(source["package"])
    if spec is None or not spec.submodule_search_locations:
        return Path(), f"the Python package {source['package']} is not installed: pip install pybullet"
    folder = Path(next(iter(spec.submodule_search_locations))).resolve() / source["folder"]
    absent = [name for name in source["links"].values() if not (folder / name).is_file()]
    return folder, f"not in {folder}: {', '.join(absent)}" if absent else ""


@dataclass(frozen=True)
class JointLimit:
    """Limits of one joint.

    Args:
        lower, upper: position range [rad].
        velocity: largest velocity [rad/s].
        acceleration: largest acceleration [rad/s^2].
        jerk: largest jerk [rad/s^3].
        effort: largest torque [N m].
        effort_rate: largest torque rate [N m/s].
    """

    lower: float
    upper: float
    velocity: float
    acceleration: float
    jerk: float
    effort: float
    effort_rate: float


@dataclass(frozen=True)
class CartesianLimit:
    """Largest velocity, acceleration and jerk in SI: m for translation, rad for rotation and elbow; per s, s^2, s^3."""

    velocity: float
    acceleration: float
    jerk: float


def joint_limits(arm_id: str = "panda") -> dict[str, JointLimit]:
    """Return the limits by full joint name, joints 1 to 7 in order."""
    return {f"{arm_id}_{joint}": JointLimit(**values) for joint, values in config("joint_limits")["joints"].items()}


def joint_limit_parameters(arm_id: str = "panda") -> dict[str, dict[str, bool | float]]:
    """Return the content of ros_control's parameters `joint_limits/` by full joint name."""
    parameters: dict[str, dict[str, bool | float]] = {}
    for joint, limit in joint_limits(arm_id).items():
        parameters[joint] = {"has_position_limits": True, "min_position": limit.lower, "max_position": limit.upper}
        for field in ("velocity", "acceleration", "jerk", "effort", "effort_rate"):
            parameters[joint] |= {f"has_{field}_limits": True, f"max_{field}": getattr(limit, field)}
    return parameters


def cartesian_limits() -> dict[str, CartesianLimit]:
    """Return the limits of `translation`, `rotation` and `elbow`."""
    return {name: CartesianLimit(**values) for name, values in config("cartesian_limits").items()}


def friction_parameters(arm_id: str = "panda") -> dict[str, dict[str, float]]:
    """Return phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the friction sigmoid by full joint name (config/friction)."""
    return {f"{arm_id}_{joint}": dict(values) for joint, values in config("friction")["sigmoid"].items()}


def ignored_pairs(arm_id: str = "panda", hand: bool = True) -> list[tuple[str, str]]:
    """Return the link pairs not to test for self-collision, besides those with a common joint (config/collision)."""
    pairs = config("collision")["ignored_pairs"]
    return [
        (f"{arm_id}_{first}", f"{arm_id}_{second}")
        for first, second in pairs
        if hand or {first, second}.isdisjoint(HAND_LINKS)
    ]
