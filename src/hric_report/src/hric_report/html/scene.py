"""Scene of the 3D replay in the browser: robots with links, shapes, joints and joint positions, moving objects."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from hric_bags.reader import ControlRecord
from hric_core import resources
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, quaternion_from_rotation
from hric_core.meshes.canonical import UnreadableMeshError
from hric_core.urdf import Joint, Mimic, Shape, mimic_laws, read
from hric_report.style import Stops
from hric_skin import REGION_KEYS, SCALE, Skin, shade

GREY = (0.86, 0.87, 0.88, 1.0)
"""Colour of links without a material: red, green, blue and opacity, each 0 to 1."""


@dataclass(frozen=True)
class SceneTrack:
    """Motion of a marker or of a frame that is not attached to a joint.

    Attributes:
        kind: marker or frame.
        name: name for display.
        parent: link in whose frame the values are given; any other name: the world frame.
        time: times, shape (n,) [s].
        values: position of a marker, shape (n, 3) [m]; or position and quaternion x y z w of a frame, shape (n, 7);
            NaN: not visible.
        trail: True to draw a trail.
    """

    kind: str
    name: str
    parent: str
    time: FloatArray
    values: FloatArray
    trail: bool = False


@dataclass(frozen=True)
class ScenePlate:
    """Force plate in the replay, with the force on it.

    Attributes:
        name: name for display.
        parent: link to which the plate is fixed; any other name: the world frame.
        xyz, quaternion: centre of the surface [m], and orientation x y z w; z is normal to the surface.
        size: size along x and y [m].
        time: times of the forces, shape (n,) [s].
        force: force on the plate, in the plate's axes, shape (n, 3) [N].
    """

    name: str
    parent: str
    xyz: tuple[float, ...]
    quaternion: tuple[float, ...]
    size: tuple[float, float]
    time: FloatArray
    force: FloatArray


@dataclass(frozen=True)
class Arrow:
    """Force over time, drawn as an arrow.

    Attributes:
        name: name for display.
        colour: role of the colour (see `style.ROLES`), or "limit".
        parent: link in whose frame force and point are given; any other name: the world frame.
        time: times, shape (n,) [s].
        force: forces, shape (n, 3) [N].
        point: points of action, shape (n, 3) [m].
        per_newton: length of the arrow per force [m/N].
        ends: True if the arrow ends at the point of action, False if it starts there.
    """

    name: str
    colour: str
    parent: str
    time: FloatArray
    force: FloatArray
    point: FloatArray
    per_newton: float
    ends: bool


@dataclass(frozen=True)
class SceneLines:
    """Lines through points fixed to links, such as muscles, coloured by values over time.

    Attributes:
        points: points along each line, as (link, position in its frame [m]), by name of the line.
        time: times of the values, shape (n,) [s].
        values: values that determine the colours, shape (n, lines).
        scale: colour scale as pairs of value and colour.
        title: title of the colour scale.
    """

    points: Mapping[str, Sequence[tuple[str, tuple[float, ...]]]]
    time: FloatArray
    values: FloatArray
    scale: Stops
    title: str


class SceneTouch(NamedTuple):
    """Contact on a person, which colours regions of the skin in the replay.

    Attributes:
        begin, end: time of the contact on the time axis of the page [s].
        regions: regions that may be touched, see `hric_skin.REGION_KEYS`.
        share: largest share of the limit [1]; None: not known.
    """

    begin: float
    end: float
    regions: tuple[str, ...]
    share: float | None


@dataclass(frozen=True)
class SceneSkin:
    """Skin of a person: a surface that follows the links of the body and is drawn instead of the links' shapes.

    Attributes:
        links: names of the links that move the surface.
        inverses: inverse poses of the links in the bind pose, row by row, shape (k, 16).
        vertices: vertices in the bind pose, shape (n, 3) [m].
        colours: red, green, blue of each vertex, shape (n, 3).
        indices, weights: indices into `links` of four links for each vertex, and their weights in its motion [1],
            shape (n, 4) each.
        faces: indices of vertices, shape (m, 3).
        regions: index into `keys` of each vertex, shape (n,).
        keys: names of the body regions, see `hric_skin.REGION_KEYS`.
        scale: colours of a region by share of its limit: pairs of share [1] and red, green, blue.
        unknown: colour of a region whose share of the limit is not known.
        touches: contacts over time, see `SceneTouch`.
    """

    links: tuple[str, ...]
    inverses: FloatArray
    vertices: FloatArray
    colours: FloatArray
    indices: npt.NDArray[np.int64]
    weights: FloatArray
    faces: npt.NDArray[np.int32]
    regions: npt.NDArray[np.int64]
    keys: tuple[str, ...] = REGION_KEYS
    scale: tuple[tuple[float, list[float]], ...] = tuple((share, shade(share).tolist()) for share, _ in SCALE)
    unknown: tuple[float, ...] = tuple(shade(None).tolist())
    touches: Sequence[SceneTouch] = ()

    @classmethod
    def of(cls, skin: Skin) -> "SceneSkin":
        """Return the surface of a person."""
        inverses = np.linalg.inv(skin.T_base_link).astype(np.float64).reshape(-1, 16)
        return cls(
            *(skin.links, inverses, skin.vertices, skin.colours, *skin.influences, skin.triangles, skin.region_keys)
        )


@dataclass
class SceneRobot:
    """Robot, human body or object in the replay, with its motion.

    Attributes:
        label: name of the run on a page with several runs; "": one run.
        description: URDF of the robot.
        joint_names: names of the columns of `position`.
        time: times on the time axis of the page, shape (n,) [s].
        position: joint positions, shape (n, j) [rad, m].
        tracks: markers and frames with their own motion.
        role: colour role on a page with several runs, as `Curve.role`; "": colours of the description.
        tip: point whose trail is drawn, as (link, position in its frame [m]); None: no trail.
        plates: force plates near the robot.
        pose: fixed pose of the root link in the world.
        arrows: forces on the robot.
        motion: motion of the root link in the world; None: the root link is fixed.
        lines: lines between points of the links, such as muscles; None: no lines.
        skin: surface in place of the shapes; None: the shapes are drawn.
    """

    label: str
    description: str
    joint_names: tuple[str, ...]
    time: FloatArray
    position: FloatArray
    tracks: list[SceneTrack] = field(default_factory=list)
    role: str = ""
    tip: tuple[str, tuple[float, ...]] | None = None
    plates: list[ScenePlate] = field(default_factory=list)
    pose: Pose = field(default_factory=Pose)
    arrows: list[Arrow] = field(default_factory=list)
    motion: SceneTrack | None = None
    lines: SceneLines | None = None
    skin: SceneSkin | None = None


class PageScene:
    """Scene of all robots of a page; meshes that robots share are stored once.

    Attributes:
        notes: notes for the page's reader on parts that could not be drawn.
    """

    def __init__(self, blob: "Blob") -> None:
        self._blob = blob
        self._meshes: list[dict[str, object]] = []
        self._mesh_of: dict[tuple[str, tuple[float, ...]], list[dict[str, object]]] = {}
        self._robots: list[dict[str, object]] = []
        self.notes: list[str] = []

    def add(self, robot: SceneRobot) -> None:
        """Add a robot to the scene.

        Raises:
            DescriptionError: the robot's description cannot be read.
        """
        described = read(robot.description)
        laws, joints = mimic_laws(described.joints), described.joints.values()
        links = [
            {"name": link.name, "visuals": [part for shape in link.visuals for part in self._visuals(shape)]}
            for link in described.links.values()
        ]
        self._robots.append(
            {
                "label": robot.label,
                "role": robot.role,
                "links": links,
                "joints": [_joint(joint, laws.get(joint.name), robot.joint_names) for joint in joints],
                "columns": len(robot.joint_names),
                "time": self._blob.add(robot.time, "f8"),
                "position": self._blob.add(robot.position, "f4"),
                "tracks": [self._packed(track) for track in robot.tracks],
                "plates": [self._packed(plate) for plate in robot.plates],
                "pose": {"xyz": robot.pose.position, "quaternion": robot.pose.orientation},
                "arrows": [self._packed(arrow) for arrow in robot.arrows],
                "motion": None if robot.motion is None else self._packed(robot.motion),
                "lines": None if robot.lines is None else self._packed(robot.lines),
                "skin": None if robot.skin is None else self._packed(robot.skin),
                "tip": None if robot.tip is None else {"link": robot.tip[0], "xyz": robot.tip[1]},
            }
        )

    def data(self) -> dict[str, object]:
        """Return the robots and meshes as plain values for the page."""
        return {"robots": self._robots, "meshes": self._meshes}

    def _packed(self, item: SceneTrack | ScenePlate | Arrow | SceneLines | SceneSkin) -> dict[str, object]:
        """Return the attributes of an item as plain values; an array is replaced by its location in the blob."""
        return {
            field.name: self._blob.add(
                value, "f8" if field.name == "time" else "u4" if value.dtype.kind == "i" else "f4"
            )
            if isinstance(value := getattr(item, field.name), np.ndarray)
            else value
            for field in fields(item)
        }

    def _visuals(self, shape: Shape) -> list[dict[str, object]]:
        """Return the parts of a visual shape; a mesh has one per colour, which overrides the colour in the URDF."""
        if shape.kind == "capsule":
            self.notes.append("a link is drawn without its shape <capsule>")
            return []
        parts = self._mesh(shape.address, shape.size) if shape.kind == "mesh" else [{shape.kind: shape.size}]
        common = {**_origin(shape.T_link_shape), "rgba": shape.colour or GREY}
        return [{**common, **part} for part in parts]

    def _mesh(self, address: str, scale: tuple[float, ...]) -> list[dict[str, object]]:
        key = (address, scale)
        if key not in self._mesh_of:
            self._mesh_of[key] = self._read_mesh(address, scale)
        return self._mesh_of[key]

    def _read_mesh(self, address: str, scale: tuple[float, ...]) -> list[dict[str, object]]:
        from hric_report.html.meshes import few_triangles

        try:
            parts = few_triangles(mesh_path(address), (scale[0], scale[1], scale[2]))
        except (HricError, OSError, UnreadableMeshError) as error:
            self.notes.append(
                f"a link is drawn without its mesh: {Path(address).name}: "
                f"{error if isinstance(error, HricError) else 'cannot be read'}"
            )
            return []
        first = len(self._meshes)
        self._meshes += [
            {"vertices": self._blob.add(surface.vertices, "f4"), "faces": self._blob.add(surface.faces, "u4")}
            for surface, _ in parts
        ]
        colours = ({} if colour is None else {"rgba": colour} for _, colour in parts)
        return [{"mesh": first + k, **colour} for k, colour in enumerate(colours)]


def mesh_path(address: str) -> Path:
    """Return the file of a mesh; a Panda mesh that has a different path on this machine is found by its name.

    Raises:
        HricError: the mesh was not found.
    """
    try:
        return resources.resolve(address)
    except HricError as error:
        from panda_description.parameters import folder_uri

        known = folder_uri()
        if not known:
            raise error
        there = Path(address)
        return resources.resolve(f"{known}/{there.parent.name}/{there.name}")


def _origin(T: FloatArray) -> dict[str, object]:
    return {"xyz": T[:3, 3].tolist(), "quaternion": quaternion_from_rotation(T[:3, :3])}


def _joint(joint: Joint, law: Mimic | None, columns: tuple[str, ...]) -> dict[str, object]:
    """Return a joint as plain values for the page's scripts.

    Its value is multiplier * position + offset; `column` is the index of this position, None for a fixed joint.
    """
    mimic = None if joint.name in columns else law
    source = mimic.joint if mimic else joint.name
    return {
        "name": joint.name,
        "type": joint.type,
        "parent": joint.parent,
        "child": joint.child,
        "axis": joint.axis.tolist(),
        "column": columns.index(source) if source in columns else None,
        "multiplier": mimic.multiplier if mimic else 1.0,
        "offset": mimic.offset if mimic else 0.0,
        **_origin(joint.T_parent_joint),
    }


def joint_track(log: ControlRecord, rate: float) -> tuple[FloatArray, FloatArray]:
    """Return times, shape (n,) [s], and joint positions, shape (n, j) [rad, m], at most `rate` instants per second.

    The first and the last instant of the log are always included.
    """
    chosen = instants(log.time, rate)
    return log.time[chosen], log.position[chosen]


def instants(time: FloatArray, rate: float) -> npt.NDArray[np.int64]:
    """Return indices into increasing times, shape (n,) [s]: at most `rate` per second, always the first and last."""
    cycles, span = len(time), float(time[-1] - time[0])
    count = min(cycles, max(2, int(span * rate) + 1)) if cycles > 1 else 1
    return np.unique(np.linspace(0, cycles - 1, count).round().astype(np.int64))


KINDS = {"f8": "<f8", "f4": "<f4", "u4": "<u4"}
"""Types of arrays that `data.js` reads, as little-endian numpy types."""
ALIGNMENT = 8
"""Alignment of arrays [bytes]; a typed array in a browser must start at a multiple of its element size."""


class Blob:
    """Binary data of all arrays of a page; an array object that is used several times is stored once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        # Keep a reference to each array, so that no other array gets its id.
        self._known: dict[tuple[int, str], tuple[Any, dict[str, object]]] = {}

    def add(self, values: npt.NDArray[Any], kind: str) -> dict[str, object]:
        """Store an array row by row; return its location: kind (key of KINDS), offset [bytes], number of values."""
        stored = self._known.get((id(values), kind))
        if stored is None:
            raw = np.ascontiguousarray(values, dtype=KINDS[kind]).tobytes()
            entry = {"kind": kind, "offset": self._size, "count": int(values.size)}
            padding = -len(raw) % ALIGNMENT
            self._parts.append(raw + bytes(padding))
            self._size += len(raw) + padding
            stored = self._known[id(values), kind] = (values, entry)
        return stored[1]

    def text(self) -> str:
        """Return the data of all arrays as base64."""
        return base64.b64encode(b"".join(self._parts)).decode()
