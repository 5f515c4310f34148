"""Repair of the Delft arm model in das4_v4.osim of the Dynamic Arm Simulator.

The defects and repairs are described in docs/concepts/muscle_anatomy.md. Only elements of the Delft shoulder and elbow
model are used; those of hand and wrist come from another source and are left out.
"""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import opensim

from hric_core.errors import HricError
from hric_human.muscles.fitting.groups import GROUPS

TRICEPS_INSERTION = (-0.0127, -0.0422, 0.0027)
"""Insertion of the triceps on the ulna, behind the elbow's wrapping cylinder, in axes of the ulna [m]; project default.

The insertions of the file lie inside the cylinder, where OpenSim's paths do not wrap. This one gives moment arms of 18
to 20 mm, as published.
"""
USED = {element for group in GROUPS for element in group.elements}
"""Names of the muscle elements of das4_v4.osim that are used."""
MOVED = ("tric_long_1", "tric_long_2", *(f"tric_{head}_{k}" for head in ("med", "lat") for k in range(1, 6)))
"""Names of the elements whose insertion in the file lies inside the elbow's wrapping cylinder."""


def is_das4(path: Path) -> bool:
    """Return True if a file has all used elements of das4_v4.osim.

    Raises:
        HricError: the file cannot be read.
    """
    return not _read(path)[1]


def repaired(path: Path) -> Any:
    """Return the repaired model, an opensim.Model with the muscle elements of GROUPS only.

    Raises:
        HricError: the file cannot be read, or elements are missing.
    """
    tree, missing = _read(path)
    if missing:
        raise HricError(f"{path} is not das4_v4.osim: it lacks the muscles {', '.join(missing)}")
    forces = next(tree.iterfind(".//ForceSet/objects"))
    for force in list(forces):
        if force.get("name") not in USED:
            forces.remove(force)
        elif force.get("name") in MOVED:
            _insert(force)
    for probes in tree.iter("ProbeSet"):
        probes.clear()
    with TemporaryDirectory() as folder:
        changed = Path(folder) / "repaired.osim"
        tree.write(changed)
        opensim.Logger.setLevelString("error")
        return opensim.Model(str(changed))


def _read(path: Path) -> tuple[Any, list[str]]:
    """Return the parsed file, and the elements of USED that it does not have."""
    try:
        tree = ElementTree.parse(path)
    except (OSError, ElementTree.ParseError) as error:
        raise HricError(f"{path} is not an OpenSim model: {error}") from error
    return tree, sorted(USED - {force.get("name", "") for force in tree.iterfind(".//ForceSet/objects/*")})


def _insert(force: ElementTree.Element) -> None:
    """Move the insertion of a triceps element on the ulna to TRICEPS_INSERTION."""
    for point in force.iter("PathPoint"):
        socket, location = point.find("socket_parent_frame"), point.find("location")
        if socket is not None and location is not None and str(socket.text).endswith("ulna_r"):
            location.text = " ".join(map(repr, TRICEPS_INSERTION))
