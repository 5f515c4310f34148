"""Where this package's xacro and YAML files are, in a source tree or installed."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import yaml

PACKAGE = "panda_description"


@cache
def share() -> Path:
    """Folder that holds config/ and urdf/."""
    source = Path(__file__).resolve().parents[2]
    return source if (source / "urdf").is_dir() else Path(find_package(PACKAGE))


def find_package(name: str) -> str:
    """Folder of any ROS package on ROS_PACKAGE_PATH; raises rospkg.ResourceNotFound."""
    import rospkg  # only an installed tree or a foreign $(find) needs it, and it is slow to import

    return str(rospkg.RosPack().get_path(name))


@cache
def config(name: str) -> dict[str, Any]:
    """Content of config/<name>.yaml; shared, so do not change it."""
    with open(share() / "config" / f"{name}.yaml", encoding="utf-8") as stream:
        content: dict[str, Any] = yaml.safe_load(stream)
    return content
