"""A serial chain read from a URDF, with everything that is rigidly fixed to its links lumped into them exactly.

No engine and no KDL here: `kdl_chain` turns the result into KDL's terms, other engines may turn it into theirs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from hric_control import urdf
from hric_control.errors import DescriptionError, UnknownNameError

FloatArray = npt.NDArray[np.float64]

MOVING_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
"""URDF joint types with one degree of freedom, and the motion they make."""


@dataclass(frozen=True)
class Inertial:
    """Mass distribution of a rigid body in some frame.

    Attributes:
        mass: [kg].
        com: centre of mass in the frame, shape (3,) [m].
        inertia: about the centre of mass, axes of the frame, tensor elements (Ixy = -integral x y dm), shape (3, 3) [kg m^2].
    """

    mass: float = 0.0
    com: FloatArray = field(default_factory=lambda: np.zeros(3))
    inertia: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    def expressed_in(self, T_new_old: FloatArray) -> Inertial:
        """The same body seen from another frame; T_new_old: pose of the present frame in the new one, shape (4, 4)."""
        R = T_new_old[:3, :3]
        return Inertial(self.mass, R @ self.com + T_new_old[:3, 3], R @ self.inertia @ R.T)

    def __add__(self, other: Inertial) -> Inertial:
        """Both bodies welded together (Steiner's theorem about the common centre of mass); both in the same frame."""
        mass = self.mass + other.mass
        if mass == 0.0:
            return Inertial(0.0, np.zeros(3), self.inertia + other.inertia)
        com = (self.mass * self.com + other.mass * other.com) / mass
        inertia = self.inertia + other.inertia
        for body in (self, other):
            r = body.com - com
            inertia = inertia + body.mass * (float(r @ r) * np.eye(3) - np.outer(r, r))
        return Inertial(mass, com, inertia)


@dataclass(frozen=True)
class ChainSegment:
    """One moving joint and the link behind it; the link's frame is the joint's frame, moved by the joint.

    Attributes:
        joint, link: URDF names.
        kind: "revolute" or "prismatic".
        T_parent_joint: pose of the joint frame at zero in the frame of the moving link before (the root for the first), shape (4, 4).
        axis: unit vector in the joint frame, shape (3,).
        inertial: link and everything rigidly attached to it, in the link frame.
    """

    joint: str
    link: str
    kind: str
    T_parent_joint: FloatArray
    axis: FloatArray
    inertial: Inertial


@dataclass(frozen=True)
class SerialChain:
    """Moving joints from root to tip.

    Attributes:
        root, tip: URDF link names.
        segments: from root to tip, one per moving joint.
        T_last_tip: pose of the tip link in the frame of the last moving link, shape (4, 4).
        tip_inertial: the tip link and all that is fixed to it further out, in the tip frame; already part of the last segment.
        T_world_root: pose of the root in the URDF's first link through fixed joints, shape (4, 4); None if a joint moves the root.
        frozen_joints: movable joints of side branches (fingers), counted as fixed at zero.
    """

    root: str
    tip: str
    segments: tuple[ChainSegment, ...]
    T_last_tip: FloatArray
    tip_inertial: Inertial
    T_world_root: FloatArray | None
    frozen_joints: tuple[str, ...]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Moving joints from root to tip."""
        return tuple(segment.joint for segment in self.segments)

    def with_load(self, load: Inertial) -> SerialChain:
        """The same chain with `load` (in the tip frame) welded on."""
        last = self.segments[-1]
        heavier = replace(last, inertial=last.inertial + load.expressed_in(self.T_last_tip))
        return replace(self, segments=(*self.segments[:-1], heavier))


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> FloatArray:
    """R = Rz(yaw) Ry(pitch) Rx(roll), the URDF's fixed-axis angles [rad]; shape (3, 3)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _vector(element: ElementTree.Element | None, attribute: str, default: tuple[float, float, float], where: str) -> FloatArray:
    text = None if element is None else element.get(attribute)
    if text is None:
        return np.array(default)
    words = text.split()
    if len(words) != 3:
        raise DescriptionError(f"{where}: {attribute} must be three numbers; got {text!r}")
    return np.array([urdf.as_number(word, f"{where}: {attribute}") for word in words])


def _transform(origin: ElementTree.Element | None, where: str) -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = rotation_from_rpy(*_vector(origin, "rpy", (0.0, 0.0, 0.0), where))
    T[:3, 3] = _vector(origin, "xyz", (0.0, 0.0, 0.0), where)
    return T


@dataclass(frozen=True)
class _Joint:
    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: FloatArray
    axis: FloatArray


class _Tree:
    """Links and joints of a URDF by name."""

    def __init__(self, urdf_xml: str) -> None:
        robot = urdf.parse(urdf_xml)
        self.links = {str(link.get("name")): link for link in robot.findall("link")}
        self.parent_joint: dict[str, _Joint] = {}
        self.child_joints: dict[str, list[_Joint]] = {name: [] for name in self.links}
        for name, element in urdf.joints(robot).items():
            joint = self._joint(name, element)
            self.parent_joint[joint.child] = joint
            self.child_joints[joint.parent].append(joint)

    def _joint(self, name: str, element: ElementTree.Element) -> _Joint:
        ends = []
        for role in ("parent", "child"):
            end = element.find(role)
            link = "" if end is None else end.get("link", "")
            if link not in self.links:
                raise UnknownNameError("link", link, self.links, f"<{role}> of joint {name}")
            ends.append(link)
        axis = _vector(element.find("axis"), "xyz", (1.0, 0.0, 0.0), f"joint {name}")
        length = float(np.linalg.norm(axis))
        kind = str(element.get("type"))
        if kind in MOVING_KINDS and length == 0.0:
            raise DescriptionError(f"joint {name} has an axis of length zero")
        return _Joint(name, kind, ends[0], ends[1], _transform(element.find("origin"), f"joint {name}"), axis / (length or 1.0))

    def inertial(self, link: str) -> Inertial:
        """Inertial of one link, in its frame; zero if it has none."""
        element = self.links[link].find("inertial")
        if element is None:
            return Inertial()
        where, mass, tensor = f"link {link}", element.find("mass"), element.find("inertia")
        if mass is None or tensor is None:
            raise DescriptionError(f"{where}: <inertial> needs <mass> and <inertia>")
        xx, yy, zz, xy, xz, yz = (urdf.number(tensor, key, where) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
        body = Inertial(urdf.number(mass, "value", where), np.zeros(3), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        return body.expressed_in(_transform(element.find("origin"), f"<inertial> of link {link}"))

    def path(self, root: str, tip: str) -> list[_Joint]:
        """Joints from root to tip."""
        joints: list[_Joint] = []
        link = tip
        while link != root:
            if link not in self.parent_joint:
                raise DescriptionError(f"link {tip} does not hang on link {root}")
            joints.insert(0, self.parent_joint[link])
            link = joints[0].parent
        return joints

    def walk_branch(self, link: str, without: str | None, T: FloatArray) -> Iterator[tuple[str, FloatArray, _Joint]]:
        """Links beyond `link` (not through the joint `without`): name, pose seen from where T started, the joint before it."""
        for joint in self.child_joints[link]:
            if joint.name != without:
                T_child = T @ joint.T_parent_joint
                yield joint.child, T_child, joint
                yield from self.walk_branch(joint.child, None, T_child)


def parse_chain(urdf_xml: str, root: str, tip: str) -> SerialChain:
    """Read the chain from link `root` to link `tip`.

    Fixed joints on the way are folded into the transforms, links and whole branches fixed on the way into the inertials of the moving links.
    What is fixed to the root does not matter to the dynamics and is left out.

    Raises:
        DescriptionError: not XML, no such path, a joint type with more than one degree of freedom on the path, no moving joint.
        UnknownNameError: a link that does not exist.
    """
    tree = _Tree(urdf_xml)
    for link in (root, tip):
        if link not in tree.links:
            raise UnknownNameError("link", link, tree.links, "the robot description")
    path = tree.path(root, tip)
    return _Builder(tree, root, tip, path).build()


class _Builder:
    """Walks from root to tip and collects segments."""

    def __init__(self, tree: _Tree, root: str, tip: str, path: list[_Joint]) -> None:
        self.tree, self.root, self.tip, self.path = tree, root, tip, path
        self.segments: list[ChainSegment] = []
        self.frozen: list[str] = []

    def build(self) -> SerialChain:
        T = np.eye(4)  # pose of the link now reached in the frame of the last moving link
        for here, joint in enumerate(self.path):
            T = T @ joint.T_parent_joint
            if joint.kind in MOVING_KINDS:
                self.segments.append(ChainSegment(joint.name, joint.child, MOVING_KINDS[joint.kind], T, joint.axis, Inertial()))
                T = np.eye(4)
            elif joint.kind != "fixed":
                valid = ", ".join(("fixed", *MOVING_KINDS))
                raise DescriptionError(f"joint {joint.name} between {self.root} and {self.tip} is {joint.kind}; valid: {valid}")
            self._weld(joint.child, self.path[here + 1].name if here + 1 < len(self.path) else None, T)
        if not self.segments:
            raise DescriptionError(f"no moving joint between {self.root} and {self.tip}")
        tip_inertial = self._branch(self.tip, None, np.eye(4))
        return SerialChain(self.root, self.tip, tuple(self.segments), T, tip_inertial, self._mounting(), tuple(dict.fromkeys(self.frozen)))

    def _branch(self, link: str, onward: str | None, T: FloatArray) -> Inertial:
        total = self.tree.inertial(link).expressed_in(T)
        for name, T_link, joint in self.tree.walk_branch(link, onward, T):
            total = total + self.tree.inertial(name).expressed_in(T_link)
            if joint.kind != "fixed":
                self.frozen.append(joint.name)
        return total

    def _weld(self, link: str, onward: str | None, T: FloatArray) -> None:
        """Add a link of the path and its side branches to the last moving link."""
        if self.segments:
            last = self.segments[-1]
            self.segments[-1] = replace(last, inertial=last.inertial + self._branch(link, onward, T))

    def _mounting(self) -> FloatArray | None:
        T, link = np.eye(4), self.root
        while link in self.tree.parent_joint:
            joint = self.tree.parent_joint[link]
            if joint.kind != "fixed":
                return None
            T, link = joint.T_parent_joint @ T, joint.parent
        return T
