"""JavaScript libraries of an HTML page, plotly.js and three.js, read from pinned Python packages.

plotly.js (MIT): plotly/package_data/plotly.min.js of the wheel `plotly`.
three.js (MIT): in the mesh viewer page of the wheel `trimesh` (MIT), whose first line of code, after the licence, is
three.min.js as released.
"""

import hashlib
import importlib.util
import zipfile
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from hric_core.errors import FailureError

VIEWER, TEMPLATE = "resources/templates/viewer.zip", "viewer.html.template"
THREE_BEGINS = "!function(t,e){"
THREE_RELEASE, THREE_SHA256 = "140", "f1bfa6255b76bf45308d5e68a0ced7ea6477f6d61798d60639221ec6f4a12212"
"""Release of three.js, and SHA-256 of its script, which proves that the extracted text is exactly this script."""


@dataclass(frozen=True)
class Library:
    """Third-party JavaScript library.

    Attributes:
        name: name, licence and origin, for the footer of the page.
        text: JavaScript, with its licence line.
    """

    name: str
    text: str


def plotly() -> Library:
    """Read plotly.js from the Python package plotly.

    Raises:
        HricError: the Python package plotly is not installed, or lacks the file.
    """
    path = _package("plotly") / "package_data" / "plotly.min.js"
    try:
        return Library(f"plotly.js (MIT licence), from plotly {version('plotly')}", path.read_text())
    except OSError as error:
        raise FailureError(
            f"cannot read plotly.js: {error}; run scripts/setup, which installs the pinned plotly"
        ) from error


def three() -> Library:
    """Extract three.js from the Python package trimesh.

    Raises:
        HricError: the package trimesh is not installed, or does not contain this release of three.js.
    """
    path = _package("trimesh") / VIEWER
    try:
        with zipfile.ZipFile(path) as archive:
            lines = archive.read(TEMPLATE).decode().splitlines()
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise FailureError(
            f"cannot read three.js from {path}: {error}; run scripts/setup, which installs the pinned trimesh"
        ) from error
    matches = [line for line in lines if line.startswith(THREE_BEGINS) and _sha256(line) == THREE_SHA256]
    if not matches:
        raise FailureError(
            f"{path} does not contain three.js r{THREE_RELEASE}; run scripts/setup, which installs the pinned trimesh"
        )
    licence = "/* three.js: Copyright 2010-2022 Three.js Authors, SPDX-License-Identifier: MIT */\n"
    return Library(f"three.js (MIT licence), from trimesh {version('trimesh')}", licence + matches[0])


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _package(name: str) -> Path:
    spec = importlib.util.find_spec(name)
    if spec is None or not spec.submodule_search_locations:
        raise FailureError(f"the Python package {name} is not installed; run scripts/setup, which installs it")
    return Path(next(iter(spec.submodule_search_locations)))
