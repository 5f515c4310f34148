"""Files that a URDF or a world file refers to: plain paths, file:// and package:// addresses."""

import os
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

from hric_core import plugins
from hric_core.errors import DescriptionError, HricError, check_known
from hric_core.urdf.elements import parse


@lru_cache(maxsize=4)
def _packages(search_path: str) -> dict[str, Path]:
    packages: dict[str, Path] = {}
    for root in filter(None, search_path.split(os.pathsep)):
        for folder, folders, files in os.walk(root, followlinks=True):
            if "package.xml" in files:
                name = ElementTree.parse(Path(folder) / "package.xml").findtext("name", Path(folder).name).strip()
                packages.setdefault(name, Path(folder))
                folders.clear()
            elif "CATKIN_IGNORE" in files:
                folders.clear()
    return packages


def package_path(name: str) -> Path:
    """Return the folder of a ROS package, searched for in ROS_PACKAGE_PATH.

    Raises:
        UnknownNameError: no such package.
    """
    packages = _packages(plugins.packages_path())
    check_known("package", [name], packages, "ROS_PACKAGE_PATH")
    return packages[name]


def resolve(address: str, relative_to: Path | None = None) -> Path:
    """Return the path of the existing file to which an address refers.

    Args:
        address: a path, file://..., or package://<package>/<path>.
        relative_to: folder to which a relative path refers; the working directory by default.

    Raises:
        HricError: there is no such file or package.
    """
    parts = urlparse(address)
    if parts.scheme == "package":
        package, _, rest = (parts.netloc + parts.path).lstrip("/").partition("/")
        path = package_path(package) / unquote(rest)
    elif parts.scheme not in ("", "file") and len(parts.scheme) > 1:
        raise HricError(f"{address}: scheme {parts.scheme}:// is not known; valid: a path, file://, package://")
    else:
        path = (relative_to or Path()) / _local(address)
    if not path.is_file():
        raise HricError(f"no file {path}" + (f" ({address})" if str(path) != address else ""))
    return path


def _local(address: str) -> Path:
    parts = urlparse(address)
    return Path(unquote(parts.netloc + parts.path)) if parts.scheme == "file" else Path(address).expanduser()


def anchored(document: str | bytes, folder: Path) -> str:
    """Return a robot description with its relative file names made absolute, so that any process can read it.

    Args:
        document: text, or the bytes of a file in the encoding that it declares.
        folder: folder of the description, to which relative file names refer.

    Raises:
        DescriptionError: the document is not a URDF.
    """
    root = parse(document)
    for element in root.iter():
        address = element.get("filename") if element.tag in ("mesh", "texture") else None
        if address and urlparse(address).scheme in ("", "file"):
            element.set("filename", str(folder.resolve() / _local(address)))
    return ElementTree.tostring(root, encoding="unicode")


def read_description(path: Path) -> str:
    """Return the text of a URDF file, with relative file names made absolute.

    Raises:
        DescriptionError: the file cannot be read, or is not a URDF.
    """
    try:
        return anchored(path.read_bytes(), path.parent)
    except OSError as error:
        raise DescriptionError(f"cannot read {path}: {error.strerror}") from error
