"""The two JavaScript libraries of a page, as they lie in pinned Python packages of the workspace; none is kept here.

plotly.js (MIT): plotly/package_data/plotly.min.js of the wheel `plotly`.
three.js (MIT): in the page that the wheel `trimesh` (MIT) shows meshes with; its first line of code is three.min.js as
released, after its licence.
"""

import importlib.util
import zipfile
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from hric_core.errors import FailureError

VIEWER, TEMPLATE = "resources/templates/viewer.zip", "viewer.html.template"
THREE_BEGINS = "!function(t,e){"


@dataclass(frozen=True)
class Library:
    """A script of others.

    Attributes:
        name: with its licence and where it comes from, for the page's foot.
        text: JavaScript, with its licence line.
    """

    name: str
    text: str


def plotly() -> Library:
    """plotly.js.

    Raises:
        HricError: the package is not installed, or has no such file.
    """
    path = _package("plotly") / "package_data" / "plotly.min.js"
    try:
        return Library(f"plotly.js (MIT licence), from plotly {version('plotly')}", path.read_text())
    except OSError as error:
        raise FailureError(f"cannot read plotly.js: {error}; scripts/setup installs the pinned plotly") from error


def three() -> Library:
    """three.js.

    Raises:
        HricError: the package is not installed, or has it no longer.
    """
    path = _package("trimesh") / VIEWER
    try:
        with zipfile.ZipFile(path) as archive:
            lines = archive.read(TEMPLATE).decode().splitlines()
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise FailureError(
            f"cannot read three.js from {path}: {error}; scripts/setup installs the pinned package trimesh"
        ) from error
    found = [line for line in lines if line.startswith(THREE_BEGINS)]
    if not found:
        raise FailureError(f"{path} has no three.js in it any more; the pinned version of trimesh has")
    licence = "/* three.js: Copyright 2010-2022 Three.js Authors, SPDX-License-Identifier: MIT */\n"
    return Library(f"three.js (MIT licence), from trimesh {version('trimesh')}", licence + found[0])


def _package(name: str) -> Path:
    found = importlib.util.find_spec(name)
    if found is None or not found.submodule_search_locations:
        raise FailureError(f"the Python package {name} is not installed; scripts/setup installs it, pinned")
    return Path(next(iter(found.submodule_search_locations)))
