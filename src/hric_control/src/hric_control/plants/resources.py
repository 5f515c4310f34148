"""Finding files that a URDF or a world names: plain paths, file:// and package:// addresses."""

import os
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

from hric_control.errors import HricError, check_known


@lru_cache(maxsize=4)
def _packages(search_path: str) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for root in filter(None, search_path.split(os.pathsep)):
        for folder, folders, files in os.walk(root, followlinks=True):
            if "package.xml" in files:
                name = ElementTree.parse(Path(folder) / "package.xml").findtext("name", Path(folder).name).strip()
                found.setdefault(name, Path(folder))
                folders.clear()
            elif "CATKIN_IGNORE" in files:
                folders.clear()
    return found


def package_path(name: str) -> Path:
    """Folder of a ROS package, by ROS_PACKAGE_PATH.

    Raises:
        UnknownNameError: no such package.
    """
    packages = _packages(os.environ.get("ROS_PACKAGE_PATH", ""))
    check_known("package", [name], packages, "ROS_PACKAGE_PATH")
    return packages[name]


def resolve(address: str, relative_to: Path | None = None) -> Path:
    """Path of an existing file.

    Args:
        address: a path, file://..., or package://<package>/<path>.
        relative_to: folder against which relative paths are meant.

    Raises:
        HricError: there is no such file or package.
    """
    parts = urlparse(address)
    if parts.scheme == "package":
        path = package_path(parts.netloc) / unquote(parts.path).lstrip("/")
    elif parts.scheme == "file":
        path = Path(unquote(parts.netloc + parts.path))
    elif parts.scheme and len(parts.scheme) > 1:
        raise HricError(f"{address}: scheme {parts.scheme}:// is not known; valid: a path, file://, package://")
    else:
        path = Path(address).expanduser()
        if relative_to is not None and not path.is_absolute():
            path = relative_to / path
    if not path.is_file():
        raise HricError(f"no file {path}" + (f" ({address})" if str(path) != address else ""))
    return path
