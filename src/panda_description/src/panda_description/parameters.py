"""Joint limits, friction and self-collision exceptions of the Panda from config/, and paths of this package's files."""

import importlib.util
import logging
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hric_core.parameters import package_yaml

LOG = logging.getLogger("hric.panda_description")
PACKAGE = "panda_description"
LIMIT_SETS = ("panda", "fr3")
HAND_LINKS = {"hand", "leftfinger", "rightfinger"}


@cache
def share() -> Path:
    """Return the folder of this package that contains config/ and urdf/, in a source tree or installed."""
    source = Path(__file__).resolve().parents[2]
    return source if (source / "urdf").is_dir() else Path(find_package(PACKAGE))


def find_package(name: str) -> str:
    """Return the folder of any ROS package on ROS_PACKAGE_PATH; raises rospkg.ResourceNotFound."""
    import rospkg  # only an installed tree or a foreign $(find) needs it, and it is slow to import

    return str(rospkg.RosPack().get_path(name))


def config(name: str) -> dict[str, Any]:
    """Return the content of config/<name>.yaml; all callers share the object, so do not change it."""
    return package_yaml(__file__, name)


@cache
def folder_uri() -> str:
    """Return the URI (file:///...) of the folder with the visual meshes; empty, with one warning, if any is missing."""
    folder, missing = _look()
    if missing:
        LOG.warning("no visual meshes of the Panda (%s); the collision capsules are drawn instead", missing)
        return ""
    return folder.as_uri()


def _look() -> tuple[Path, str]:
    """Return the folder of the visual meshes, and a text about missing ones (empty if none is missing)."""
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
        velocity: maximum velocity [rad/s].
        acceleration: maximum acceleration [rad/s^2].
        jerk: maximum jerk [rad/s^3].
        effort: maximum torque [N m].
        effort_rate: maximum torque rate [N m/s].
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
    """Maximum velocity, acceleration and jerk of one Cartesian quantity of the end effector.

    Units: m/s, m/s^2, m/s^3 for translation; rad/s, rad/s^2, rad/s^3 for rotation and elbow.
    """

    velocity: float
    acceleration: float
    jerk: float


def joint_limits(arm_id: str = "panda", limits: str = "panda") -> dict[str, JointLimit]:
    """Return the limits of joints 1 to 7 by full joint name, in order; limits: one of LIMIT_SETS."""
    joints, of_fr3 = config("joint_limits")["joints"], config("limits_fr3")
    if limits == "fr3":
        joints = {joint: {key: of_fr3[key][i] for key in row} for i, (joint, row) in enumerate(joints.items())}
    return {f"{arm_id}_{joint}": JointLimit(**values) for joint, values in joints.items()}


def joint_limit_parameters(arm_id: str = "panda", limits: str = "panda") -> dict[str, dict[str, bool | float]]:
    """Return the joint limits in the form of ros_control's parameters `joint_limits/<joint>`, by full joint name."""
    parameters: dict[str, dict[str, bool | float]] = {}
    for joint, limit in joint_limits(arm_id, limits).items():
        parameters[joint] = {"has_position_limits": True, "min_position": limit.lower, "max_position": limit.upper}
        for field in ("velocity", "acceleration", "jerk", "effort", "effort_rate"):
            parameters[joint] |= {f"has_{field}_limits": True, f"max_{field}": getattr(limit, field)}
    return parameters


def cartesian_limits() -> dict[str, CartesianLimit]:
    """Return the limits of the end effector's `translation` and `rotation`, and of the `elbow`, by these names."""
    return {name: CartesianLimit(**values) for name, values in config("cartesian_limits").items()}


def friction_parameters(arm_id: str = "panda") -> dict[str, dict[str, float]]:
    """Return phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the friction sigmoid by full joint name (friction.yaml)."""
    return {f"{arm_id}_{joint}": dict(values) for joint, values in config("friction")["sigmoid"].items()}


def rotor_inertia() -> tuple[float, ...]:
    """Return the rotor inertias of joints 1 to 7, as seen at the joint [kg m^2] (rotors.yaml)."""
    return tuple(config("rotors")["joints"].values())


def ignored_pairs(arm_id: str = "panda", hand: bool = True) -> list[tuple[str, str]]:
    """Return the link pairs to leave out of self-collision tests, in addition to those with a common joint.

    Source: config/collision.yaml. hand: include pairs with links of the hand.
    """
    pairs = config("collision")["ignored_pairs"]
    return [
        (f"{arm_id}_{first}", f"{arm_id}_{second}")
        for first, second in pairs
        if hand or {first, second}.isdisjoint(HAND_LINKS)
    ]
