"""Preparation of a URDF for PyBullet: rigidly connected links become one link, with exact masses.

The description cannot be loaded directly: PyBullet gives a link without mass 1 kg, replaces a physically impossible
inertia tensor by zero, and computes every fixed joint in every step. Here each cluster of rigidly connected links
becomes one engine link with the sum of their masses. The tensor is written along its principal axes, so that its exact
moments, whatever their sign, can be set after loading. Links with a collision shape remain as massless engine links, so
that contacts are reported with their names.
"""

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from html import escape  # the one of xml.sax loads an HTTP client
from operator import add
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hric_control.plants.models import moving_body
from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, MassProperties, homogeneous
from hric_core.geometry.transforms import inverse
from hric_core.meshes.canonical import hull_of, mesh_of, obj_text
from hric_core.urdf import ONE_COORDINATE, Joint, Robot, Shape, solids, write_inertial, write_origin, write_shape
from hric_core.urdf.writing import text
from pybullet_ros_control.hulls import without_skin

PIECE = 8191
"""Maximum length of a line that PyBullet reads correctly, line break included [bytes].

It splits a longer line into pieces of this length, even inside a number. Source: measured with PyBullet 3.2.7.
"""
NAME = 1023 + len('name=""')
"""Maximum length of a name, as an attribute [bytes]; PyBullet crashes with a longer one. Source: measured."""


@dataclass(frozen=True)
class LinkFrame:
    """Position of a link of the description in the engine's model.

    Attributes:
        body_link: name of the engine link to which the described link belongs.
        T_body_frame: pose of the described link in the engine link's frame, shape (4, 4).
    """

    body_link: str
    T_body_frame: FloatArray


@dataclass(frozen=True)
class EngineModel:
    """Model that is prepared for PyBullet.

    Attributes:
        name: name of the robot in the description.
        xml: URDF for the engine, with lines of at most `PIECE` bytes.
        base: name of the base link.
        T_root_base: pose of the base in the description's root link, shape (4, 4).
        frames: frames of all links of the description.
        moments: principal moments of each engine link with mass, 3 floats [kg m^2]; to be set after loading.
        bodies: mass, centre of mass and inertia tensor of each engine link with mass, in the link frame.
        joints: moving joints by name.
        placements: parent engine link of each moving joint, and the joint frame at q = 0 in it, shape (4, 4).
        tops: link that names the rigid cluster of each link of the description, and the pose in it.
        root: root link of the description.
        description: robot description from which the model was made.
        files: mesh files that the xml refers to, by file name; they must be in the same folder.
        hulls: corners of the convex hull of each engine link's last mesh, in the link frame, shape (n, 3) [m].
    """

    name: str
    xml: str
    base: str
    T_root_base: FloatArray
    frames: dict[str, LinkFrame]
    moments: dict[str, tuple[float, ...]]
    bodies: dict[str, MassProperties]
    joints: dict[str, Joint]
    placements: dict[str, tuple[str, FloatArray]]
    tops: dict[str, LinkFrame]
    root: str
    description: Robot
    files: dict[str, bytes]
    hulls: dict[str, FloatArray]


@dataclass
class _Cluster:
    """Rigidly connected links: `top`, the link that names the cluster, and the poses of all members in its frame."""

    top: str
    poses: dict[str, FloatArray]

    def rebase(self, top: str) -> None:
        T_new_old = inverse(self.poses[top])
        self.poses = {name: T_new_old @ T for name, T in self.poses.items()}
        self.top = top


def _clusters(robot: Robot) -> dict[str, _Cluster]:
    """Return the rigid cluster of each link; clusters are named after their topmost link."""
    of: dict[str, _Cluster] = {}
    for name, (top, T_top_link) in robot.rigid_groups().items():
        of[name] = of.setdefault(top, _Cluster(top, {}))
        of[name].poses[name] = T_top_link
    return of


def _write_inertial(link: Element, mass: MassProperties, moments: FloatArray, R: FloatArray) -> None:
    """Write the inertia along its principal axes, or a sphere's if it is impossible; exact moments are set later."""
    low, middle, high = sorted(moments)
    written = moments if low > 0.0 and low + middle >= high else np.full(3, max(abs(high), abs(low)))
    write_inertial(link, mass.mass, homogeneous(R, mass.com), np.diag(written))


def _lines(element: Element) -> Iterator[str]:
    """Yield the lines of an element, with each attribute on a separate line.

    Raises:
        DescriptionError: an attribute is longer than PyBullet can read.
    """
    yield f"<{element.tag}"
    for name, value in element.attrib.items():
        line = f'{name}="{escape(value)}"'
        limit = NAME if name == "name" else PIECE - 1
        if (size := len(line.encode())) > limit:
            raise DescriptionError(
                f"{name} of <{element.tag}>: {size} bytes ({line[:40]}...); PyBullet reads an attribute of at most "
                f"{limit} bytes"
            )
        yield line
    yield ">"
    for child in element:
        yield from _lines(child)
    yield f"</{element.tag}>"


class _Preparation:
    """State of the preparation of one model by `prepare`."""

    def __init__(
        self, robot: Robot, loads: Mapping[str, MassProperties], fixed_base: bool, visual: bool, stops: bool
    ) -> None:
        self.robot, self.fixed_base, self.visual, self.stops = robot, fixed_base, visual, stops
        self.of = _clusters(robot)
        self.loads = loads
        self.element = Element("robot", name=robot.name)
        self.moments: dict[str, tuple[float, ...]] = {}
        self.bodies: dict[str, MassProperties] = {}
        self.placements: dict[str, tuple[str, FloatArray]] = {}
        self.frames: dict[str, LinkFrame] = {}
        self.files: dict[str, bytes] = {}
        self.hulls: dict[str, FloatArray] = {}

    def mass(self, cluster: _Cluster) -> MassProperties:
        members = (
            (T, part)
            for name, T in cluster.poses.items()
            for part in (self.robot.links[name].mass, self.loads.get(name))
        )
        parts = [part.moved(T) for T, part in members if part is not None and (part.mass > 0.0 or part.inertia.any())]
        return moving_body(self.robot, cluster.top, reduce(add, parts) if parts else MassProperties())

    def choose_base(self) -> FloatArray:
        """Choose the base link of a fixed model, and return its pose in the root link, shape (4, 4).

        A link of the root cluster with a collision shape is preferred: the engine then treats it as a static body and
        does not test it against other static bodies.
        """
        cluster = self.of[self.robot.root]
        shaped = [name for name in cluster.poses if self.robot.links[name].collisions]
        if self.fixed_base and shaped and self.robot.root not in shaped:
            T_root_base = cluster.poses[shaped[0]]
            cluster.rebase(shaped[0])
            return T_root_base
        return np.eye(4)

    def write_link(self, name: str, mass: MassProperties) -> Element:
        element = SubElement(self.element, "link", name=name)
        moments, R = mass.principal()
        _write_inertial(element, mass, moments, R)
        if mass.mass > 0.0:
            self.moments[name], self.bodies[name] = tuple(moments.tolist()), mass
        return element

    def write_shapes(self, parent: Element, shapes: Iterable[Shape], T: FloatArray, purpose: str) -> None:
        """Write shapes, at a pose in the link `parent`; a mesh is drawn as it is, but collides as its convex hull."""
        for shape in shapes:
            T_parent_shape = T @ shape.T_link_shape
            if shape.kind == "mesh":
                drawn = purpose == "visual"
                text = mesh_of(shape) if drawn else self.hull_text(parent, shape, T_parent_shape)
                shape = replace(shape, size=(1.0, 1.0, 1.0), address=f"{hashlib.sha256(text).hexdigest()}.obj")
                self.files[shape.address] = text
            if all(shape.size):
                write_shape(parent, purpose, shape, T_parent_shape)

    def hull_text(self, parent: Element, shape: Shape, T_parent_shape: FloatArray) -> bytes:
        """Return the convex hull of a mesh as an OBJ file for the engine, and store its corners."""
        hull = hull_of(shape)
        self.hulls[parent.get("name", "")] = hull.vertices @ T_parent_shape[:3, :3].T + T_parent_shape[:3, 3]
        return obj_text(without_skin(hull), "a hull").encode()

    def write_cluster(self, cluster: _Cluster, moving: bool) -> None:
        top = self.write_link(cluster.top, self.mass(cluster) if moving else MassProperties())
        for name, T in cluster.poses.items():
            link, separate = self.robot.links[name], bool(self.robot.links[name].collisions) and name != cluster.top
            self.frames[name] = LinkFrame(name, np.eye(4)) if separate else LinkFrame(cluster.top, T)
            if self.visual:
                self.write_shapes(top, link.visuals, T, "visual")
            if separate:
                self.write_shapes(
                    self.write_link(name, MassProperties()), solids(link.collisions), np.eye(4), "collision"
                )
                fixed = SubElement(self.element, "joint", name=f"{name}__fixed", type="fixed")
                self.connect(fixed, cluster.top, name, T)
            else:
                self.write_shapes(top, solids(link.collisions), T, "collision")

    @staticmethod
    def connect(element: Element, parent: str, child: str, T: FloatArray) -> None:
        SubElement(element, "parent", link=parent)
        SubElement(element, "child", link=child)
        write_origin(element, T)

    def write_joint(self, joint: Joint) -> None:
        """Write a joint without damping and friction, which the plant adds to the efforts itself."""
        bounded = self.stops and math.isfinite(joint.lower)
        kind = joint.type if bounded or joint.type == "prismatic" else "continuous"
        element = SubElement(self.element, "joint", name=joint.name, type=kind)
        cluster = self.of[joint.parent]
        placement = self.placements[joint.name] = cluster.top, cluster.poses[joint.parent] @ joint.T_parent_joint
        self.connect(element, placement[0], joint.child, placement[1])
        SubElement(element, "axis", xyz=text(joint.axis))
        # An upper limit below the lower one means "no limit" in the engine.
        lower, upper = (joint.lower, joint.upper) if bounded else (1.0, -1.0)
        SubElement(element, "limit", lower=repr(lower), upper=repr(upper), effort="1e9", velocity="1e9")

    def run(self) -> EngineModel:
        T_root_base = self.choose_base()
        done: set[str] = set()
        for name in self.robot.links:
            cluster = self.of[name]
            if cluster.top not in done:
                done.add(cluster.top)
                self.write_cluster(cluster, moving=not (self.fixed_base and cluster is self.of[self.robot.root]))
        moving = [joint for joint in self.robot.joints.values() if joint.type != "fixed"]
        for joint in moving:
            self.write_joint(joint)
        return EngineModel(
            self.robot.name,
            "\n".join(_lines(self.element)),
            self.of[self.robot.root].top,
            T_root_base,
            self.frames,
            self.moments,
            self.bodies,
            {joint.name: joint for joint in moving},
            self.placements,
            {name: LinkFrame(cluster.top, cluster.poses[name]) for name, cluster in self.of.items()},
            self.robot.root,
            self.robot,
            self.files,
            self.hulls,
        )


def prepare(
    robot: Robot,
    *,
    loads: Mapping[str, MassProperties] | None = None,
    fixed_base: bool = True,
    collision: bool = True,
    visual: bool = False,
    stops: bool = True,
) -> EngineModel:
    """Prepare a robot description for PyBullet.

    Args:
        robot: robot description; it is not changed.
        loads: payloads by link, in the link's frame.
        fixed_base: True if the root is fixed to the world.
        collision: True to keep collision shapes.
        visual: True to keep visual shapes (only a window shows them; loading meshes is slow).
        stops: True if the engine stops the joints at the ends of their ranges.

    Raises:
        DescriptionError: a joint type that the engine lacks, a moving link without mass, or an unusable mesh.
        UnknownNameError: a load on a link that does not exist.
    """
    for name in loads or {}:
        robot.check_link(name)
    for joint in robot.joints.values():
        if joint.type not in (*ONE_COORDINATE, "fixed"):
            valid = ", ".join((*ONE_COORDINATE, "fixed"))
            raise DescriptionError(
                f"joint {joint.name}: type {joint.type!r} is not supported by PyBullet; valid: {valid}"
            )
    if not collision:
        robot = replace(robot, links={name: replace(link, collisions=()) for name, link in robot.links.items()})
    return _Preparation(robot, loads or {}, fixed_base, visual, stops).run()
