"""The robot description of an experiment: the Panda by arguments, or another robot's URDF or xacro."""

from __future__ import annotations

import inspect
from pathlib import Path

import panda_description
from hric_control.errors import HricError
from hric_experiments import config
from hric_experiments.experiment import ExperimentError, RobotSpec


def load(spec: RobotSpec) -> str:
    """Pure URDF.

    Raises:
        HricError: an argument that the description does not have, or a file that cannot be used.
    """
    if spec.urdf:
        return _from_file(resolve(spec.urdf))
    valid = [name for name in inspect.signature(panda_description.load).parameters if name not in ("arm_id", "robot_sim_type")]
    unknown = sorted(set(spec.description) - set(valid))
    if unknown:
        raise ExperimentError(f"unknown key {', '.join('robot.description.' + key for key in unknown)}; valid: {', '.join(valid)}")
    text: str = panda_description.load(arm_id=spec.arm_id, robot_sim_type=spec.hw, **spec.description)
    return text


def resolve(address: str) -> Path:
    """File of a path or a package://package/path address."""
    if address.startswith("package://"):
        package, _, rest = address.removeprefix("package://").partition("/")
        return config.package_path(package) / rest
    return Path(address).expanduser()


def _from_file(path: Path) -> str:
    try:
        text = path.read_text()
    except OSError as error:
        raise HricError(f"cannot read the robot description {path}: {error.strerror}") from error
    if path.suffix != ".xacro":
        return text
    document: str = panda_description.process_xacro(path, {}).toxml()
    return document
