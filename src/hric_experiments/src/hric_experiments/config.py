"""Where the files of this package are."""

from __future__ import annotations

from pathlib import Path

PACKAGE = "hric_experiments"


def package_path(package: str = PACKAGE) -> Path:
    """Folder of a ROS package.

    Raises:
        HricError: no such package on ROS_PACKAGE_PATH.
    """
    own = Path(__file__).resolve().parents[2]
    if package == PACKAGE and (own / "config").is_dir():
        return own
    import rospkg

    from hric_control.errors import HricError

    try:
        return Path(rospkg.RosPack().get_path(package))
    except rospkg.ResourceNotFound as error:
        raise HricError(f"no ROS package {package!r} on ROS_PACKAGE_PATH; is the workspace sourced (source scripts/env)?") from error


def experiments_path() -> Path:
    """Folder of the experiment files."""
    return package_path() / "config" / "experiments"


def references_path() -> Path:
    """Folder of the reference set-ups that reports compare with."""
    return package_path() / "config" / "references"


def studies_path() -> Path:
    """Folder of the study files."""
    return package_path() / "config" / "studies"
