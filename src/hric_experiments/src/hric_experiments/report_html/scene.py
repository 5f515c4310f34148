"""The robot of a run as the browser draws it: links with their shapes, joints, and where the joints were."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from hric_control import urdf
from hric_control.errors import HricError
from hric_control.plants import resources
from hric_experiments.bag_reader import ControlRecord
from hric_experiments.report_html.blob import Blob
from urdf_to_osim.mesh_files import UnreadableMeshError

FloatArray = npt.NDArray[np.float64]
GREY = (0.86, 0.87, 0.88, 1.0)
"""Of links without a material."""


@dataclass(frozen=True)
class Track:
    """Something that moves by itself: a marker or a frame.

    Attributes:
        kind: marker or frame.
        name: for people.
        parent: the link in whose frame it is given; a name that is no link: of the world.
        time: shape (n,) [s].
        values: position of a marker, shape (n, 3) [m]; or position and quaternion x y z w of a frame, shape (n, 7); NaN: not seen.
    """

    kind: str
    name: str
    parent: str
    time: FloatArray
    values: FloatArray


@dataclass
class Robot:
    """A robot and its motion.

    Attributes:
        label: name of the run, where a page has several.
        description: URDF.
        joint_names: columns of `position`.
        time: of the page, shape (n,) [s].
        position: shape (n, j) [rad, m].
        tracks: what else moves.
        role: colour where a page has several, as `Curve.role`; "": the description's.
    """

    label: str
    description: str
    joint_names: tuple[str, ...]
    time: FloatArray
    position: FloatArray
    tracks: list[Track] = field(default_factory=list)
    role: str = ""


class Scene:
    """All robots of a page; meshes that they share are stored once.

    Attributes:
        notes: what could not be drawn, for the reader.
    """

    def __init__(self, blob: Blob) -> None:
        self._blob = blob
        self._meshes: list[dict[str, Any]] = []
        self._mesh_of: dict[tuple[str, tuple[float, ...]], int | None] = {}
        self._robots: list[dict[str, Any]] = []
        self.notes: list[str] = []

    def add(self, robot: Robot) -> None:
        """Add a robot.

        Raises:
            DescriptionError: its description cannot be read.
        """
        root = urdf.parse(robot.description)
        materials = {m.get("name", ""): _colour(m) for m in root.findall("material")}
        names = [link.get("name", "") for link in root.findall("link")]
        shapes = [[self._visual(visual, materials) for visual in link.findall("visual")] for link in root.findall("link")]
        links = [{"name": n, "visuals": [s for s in v if s is not None]} for n, v in zip(names, shapes, strict=True)]
        self._robots.append(
            {
                "label": robot.label,
                "role": robot.role,
                "links": links,
                "joints": [_joint(name, joint, robot.joint_names) for name, joint in urdf.joints(root).items()],
                "columns": len(robot.joint_names),
                "time": self._blob.add(robot.time, "f8"),
                "position": self._blob.add(robot.position, "f4"),
                "tracks": [self._track(track) for track in robot.tracks],
            }
        )

    def data(self) -> dict[str, Any]:
        """For the page."""
        return {"robots": self._robots, "meshes": self._meshes}

    def _track(self, track: Track) -> dict[str, Any]:
        place = {"time": self._blob.add(track.time, "f8"), "values": self._blob.add(track.values, "f4")}
        return {"kind": track.kind, "name": track.name, "parent": track.parent, "width": track.values.shape[1], **place}

    def _visual(self, visual: ElementTree.Element, materials: dict[str, list[float]]) -> dict[str, Any] | None:
        shape = self._shape(visual.find("geometry"))
        if shape is None:
            return None
        material = visual.find("material")
        colour = list(GREY) if material is None else materials.get(material.get("name", ""), list(GREY))
        if material is not None and material.find("color") is not None:
            colour = _colour(material)
        return {**shape, **_origin(visual), "rgba": colour}

    def _shape(self, geometry: ElementTree.Element | None) -> dict[str, Any] | None:
        found = None if geometry is None else next(iter(geometry), None)
        if found is None:
            return None
        if found.tag == "mesh":
            number = self._mesh(found.get("filename", ""), _vector(found.get("scale", "1 1 1")))
            return None if number is None else {"mesh": number}
        keys = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}.get(found.tag)
        if keys is None:
            self.notes.append(f"a shape <{found.tag}> is not drawn")
            return None
        return {found.tag: [value for key in keys for value in _vector(found.get(key, "0"))]}

    def _mesh(self, address: str, scale: list[float]) -> int | None:
        key = (address, tuple(scale))
        if key not in self._mesh_of:
            self._mesh_of[key] = self._read_mesh(address, scale)
        return self._mesh_of[key]

    def _read_mesh(self, address: str, scale: list[float]) -> int | None:
        from hric_experiments.report_html.meshes import few_triangles

        try:
            surface = few_triangles(mesh_path(address), (scale[0], scale[1], scale[2]))
        except (HricError, OSError, UnreadableMeshError) as error:
            self.notes.append(
                f"a link is drawn without its mesh: {Path(address).name}: {error if isinstance(error, HricError) else 'cannot be read'}"
            )
            return None
        place = {"vertices": self._blob.add(surface.vertices, "f4"), "faces": self._blob.add(surface.faces, "u4")}
        self._meshes.append(place)
        return len(self._meshes) - 1


def mesh_path(address: str) -> Path:
    """File of a mesh; one of the Panda's that lay elsewhere on the machine of the run is found here by its name.

    Raises:
        HricError: it is nowhere.
    """
    try:
        return resources.resolve(address)
    except HricError as error:
        from panda_description import meshes

        known = meshes.folder_uri()
        if not known:
            raise error
        there = Path(address)
        return resources.resolve(f"{known}/{there.parent.name}/{there.name}")


def _vector(text: str) -> list[float]:
    return [float(part) for part in text.split()]


def _colour(material: ElementTree.Element) -> list[float]:
    colour = material.find("color")
    return list(GREY) if colour is None else _vector(colour.get("rgba", "1 1 1 1"))


def _origin(element: ElementTree.Element) -> dict[str, list[float]]:
    origin = element.find("origin")
    xyz, rpy = ("0 0 0", "0 0 0") if origin is None else (origin.get("xyz", "0 0 0"), origin.get("rpy", "0 0 0"))
    return {"xyz": _vector(xyz), "quaternion": Rotation.from_euler("xyz", _vector(rpy)).as_quat().tolist()}


def _joint(name: str, joint: ElementTree.Element, columns: tuple[str, ...]) -> dict[str, Any]:
    """A joint; column: of the position that moves it, null: it stands; value = multiplier * position + offset."""
    mimic, axis = joint.find("mimic"), joint.find("axis")
    source = name if mimic is None or name in columns else mimic.get("joint", "")
    follows = mimic is not None and name not in columns
    return {
        "name": name,
        "type": joint.get("type", "fixed"),
        "parent": joint.find("parent").get("link"),  # type: ignore[union-attr]
        "child": joint.find("child").get("link"),  # type: ignore[union-attr]
        "axis": _vector("1 0 0" if axis is None else axis.get("xyz", "1 0 0")),
        "column": columns.index(source) if source in columns else None,
        "multiplier": float(mimic.get("multiplier", "1")) if follows and mimic is not None else 1.0,
        "offset": float(mimic.get("offset", "0")) if follows and mimic is not None else 0.0,
        **_origin(joint),
    }


def joint_track(log: ControlRecord, rate: float) -> tuple[FloatArray, FloatArray]:
    """Positions of the joints at most `rate` times per second, always with the first and the last: (n,) [s], (n, j) [rad, m]."""
    span = float(log.time[-1] - log.time[0])
    count = min(log.cycles, max(2, int(span * rate) + 1)) if log.cycles > 1 else 1
    chosen = np.unique(np.linspace(0, log.cycles - 1, count).round().astype(np.int64))
    return log.time[chosen], log.position[chosen]
