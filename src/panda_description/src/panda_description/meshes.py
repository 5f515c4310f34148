"""Finds the visual meshes in the installed package that carries them."""

from __future__ import annotations

import importlib.util
import logging
from functools import cache
from pathlib import Path

from panda_description.files import config

LOG = logging.getLogger("hric.panda_description")


@cache
def folder_uri() -> str:
    """URI (file:///...) of the folder that config/meshes.yaml is relative to; empty, with one warning, if the package or a mesh is missing."""
    folder, missing = _look()
    if missing:
        LOG.warning("no visual meshes of the Panda (%s); the collision primitives are drawn instead", missing)
        return ""
    return folder.as_uri()


def _look() -> tuple[Path, str]:
    """Folder of the meshes, and what is missing (empty if nothing)."""
    source = config("meshes")
    spec = importlib.util.find_spec(source["package"])
    if spec is None or not spec.submodule_search_locations:
        return Path(), f"the Python package {source['package']} is not installed: pip install pybullet"
    folder = Path(next(iter(spec.submodule_search_locations))).resolve() / source["folder"]
    absent = [name for name in source["links"].values() if not (folder / name).is_file()]
    return folder, f"not in {folder}: {', '.join(absent)}" if absent else ""
