"""Robot description as a tree: links, and joints in order from the root outwards."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from xml.etree.ElementTree import Element

import numpy as np

from hric_core.errors import DescriptionError, check_known
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.transforms import rotation_about
from hric_core.urdf.shapes import Shape

WORLD = "world"
"""Root link that several arms share."""
ONE_COORDINATE = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*ONE_COORDINATE, "planar", "floating", "fixed")
BOUNDED = ("revolute", "prismatic")
NO_LIMIT = 1e4
"""Absolute value from which on a position limit counts as no limit [rad or m]; descriptions use values such as 1e16.

Project default, unconfirmed."""


@dataclass(frozen=True)
class Limit:
    """`<limit>` of a joint, as written: lower, upper [rad or m], largest effort [N m or N] and velocity [rad/s or m/s].

    None: the attribute is missing.
    """

    lower: float = 0.0
    upper: float = 0.0
    effort: float | None = None
    velocity: float | None = None


@dataclass(frozen=True)
class SafetyController:
    """`<safety_controller>` of a joint, as written: gains and soft limits [rad or m], defined as in ros_control."""

    k_velocity: float
    k_position: float = 0.0
    soft_lower: float = 0.0
    soft_upper: float = 0.0


@dataclass(frozen=True)
class Mimic:
    """Law of a mimic joint: its position is multiplier * (position of `joint`) + offset [rad or m]."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """Joint of a robot description.

    Attributes:
        type: one of JOINT_TYPES; the attributes after `axis` are only read for types with one coordinate.
        parent, child: names of the joined links.
        T_parent_joint: pose of the joint frame (the child's frame at position 0) in the parent link, shape (4, 4) [m].
        axis: unit vector of the axis in the joint frame, shape (3,).
        limit: `<limit>` as written; use the properties `lower`, `upper`, `effort` and `velocity`.
        damping: viscous friction coefficient [N m s/rad or N s/m].
        friction: Coulomb friction [N m or N].
        mimic: law of a mimic joint; None: the joint moves independently.
        safety: `<safety_controller>`; None: there is none.
        rotor_inertia: inertia of the motor's rotor, reflected to the joint [kg m^2 or kg]; None: not stated.
    """

    name: str
    type: str
    parent: str
    child: str
    T_parent_joint: FloatArray
    axis: FloatArray
    limit: Limit | None = None
    damping: float = 0.0
    friction: float = 0.0
    mimic: Mimic | None = None
    safety: SafetyController | None = None
    rotor_inertia: float | None = None

    @property
    def lower(self) -> float:
        """Lower position limit [rad or m]; -inf if the joint has no limits, -NO_LIMIT if it has only an upper one."""
        if self._unbounded or self.limit is None:
            return -math.inf
        return max(self.limit.lower, -NO_LIMIT)

    @property
    def upper(self) -> float:
        """Upper position limit [rad or m]; inf if the joint has no limits, NO_LIMIT if it has only a lower one."""
        if self._unbounded or self.limit is None:
            return math.inf
        return min(self.limit.upper, NO_LIMIT)

    @property
    def _unbounded(self) -> bool:
        limit = self.limit
        return self.type not in BOUNDED or (limit is not None and limit.lower <= -NO_LIMIT and limit.upper >= NO_LIMIT)

    @property
    def effort(self) -> float:
        """Effort limit [N m or N]; inf if it is missing or zero."""
        return (self.limit.effort if self.limit else None) or math.inf

    @property
    def velocity(self) -> float:
        """Velocity limit [rad/s or m/s]; inf if it is missing or not above zero."""
        velocity = (self.limit.velocity if self.limit else None) or 0.0
        return velocity if velocity > 0.0 else math.inf


def mimic_laws(joints: Mapping[str, Joint]) -> dict[str, Mimic]:
    """Return the law of each mimic joint by name, with chains resolved: `joint` of each law mimics no other joint."""
    laws: dict[str, Mimic] = {}
    for name, joint in joints.items():
        if (law := joint.mimic) is None:
            continue
        while (above := joints[law.joint].mimic) is not None:
            law = Mimic(above.joint, law.multiplier * above.multiplier, law.multiplier * above.offset + law.offset)
        laws[name] = law
    return laws


@dataclass(frozen=True)
class Link:
    """Link of a robot description.

    Attributes:
        mass: mass properties in the link's frame; None without `<inertial>`.
        visuals, collisions: shapes of the link.
    """

    name: str
    mass: MassProperties | None
    visuals: tuple[Shape, ...] = ()
    collisions: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class Robot:
    """Robot description: links in document order, joints by name from the root outwards.

    Attributes:
        root: name of the link without parent.
        element: `<robot>` element of the document, for content that is not in this tree (transmissions, plugins).
    """

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    element: Element = field(repr=False, compare=False)

    def check_link(self, name: str) -> None:
        """Raise UnknownNameError if there is no such link."""
        check_known("link", [name], self.links, f"robot {self.name}")

    def check_actuated(self, names: Sequence[str]) -> None:
        """Check that the named joints can be driven by actuators.

        Raises:
            UnknownNameError: a name is not that of a moving joint.
            DescriptionError: no names are given, a name is given twice, or one of the joints mimics another joint.
        """
        if not names:
            raise DescriptionError(f"robot {self.name}: no joint to drive; give at least one a <transmission>")
        if twice := [name for name in names if names.count(name) > 1]:
            raise DescriptionError(f"robot {self.name}: joint {twice[0]} is named twice among the joints to drive")
        moving = [joint.name for joint in self.joints.values() if joint.type != "fixed"]
        check_known("moving joint", names, moving, f"robot {self.name}")
        for mimic, name in ((self.joints[name].mimic, name) for name in names):
            if mimic is not None:
                raise DescriptionError(
                    f"joint {name}: it mimics {mimic.joint} and cannot be driven by itself; remove its <transmission>, "
                    "or its <mimic>"
                )

    def path(self, root: str, tip: str) -> list[Joint]:
        """Return the joints of the chain from link `root` to link `tip`.

        Raises:
            UnknownNameError: there is no such link.
            DescriptionError: `tip` is not a descendant of `root`.
        """
        self.check_link(root)
        self.check_link(tip)
        above = {joint.child: joint for joint in self.joints.values()}
        joints: list[Joint] = []
        link = tip
        while link != root:
            if link not in above:
                raise DescriptionError(f"link {tip} is not a descendant of link {root} in robot {self.name}")
            joints.insert(0, above[link])
            link = above[link].parent
        return joints

    def beyond(
        self, link: str, T: FloatArray | None = None, without: str | None = None
    ) -> Iterator[tuple[Joint, FloatArray]]:
        """Yield the joints below a link, depth first, each with the pose of its child link, shape (4, 4) [m].

        The poses are those with all joints at position 0.

        Args:
            link: link to start from.
            T: pose of this link in the frame in which the poses are returned; None: they are in the link's frame.
            without: joint that is left out with its subtree.
        """
        T_link = {link: np.eye(4) if T is None else T}
        for joint in self.joints.values():
            if joint.parent in T_link and joint.name != without:
                T_link[joint.child] = T_link[joint.parent] @ joint.T_parent_joint
                yield joint, T_link[joint.child]

    def poses(self, positions: Mapping[str, float]) -> dict[str, FloatArray]:
        """Return the poses of all links in the root link's frame, shape (4, 4) each.

        Args:
            positions: joint positions by name [rad or m]; other joints are at 0.
        """
        poses = {self.root: np.eye(4)}
        for joint in self.joints.values():
            T_joint_child, q = np.eye(4), positions.get(joint.name, 0.0)
            if joint.type == "prismatic":
                T_joint_child[:3, 3] = q * joint.axis
            elif q:
                T_joint_child[:3, :3] = rotation_about(joint.axis, q)
            poses[joint.child] = poses[joint.parent] @ joint.T_parent_joint @ T_joint_child
        return poses

    def rigid_groups(self) -> dict[str, tuple[str, FloatArray]]:
        """Return for each link the topmost link to which it is rigidly fixed, and its pose in it, shape (4, 4) [m]."""
        groups = {self.root: (self.root, np.eye(4))}
        for joint in self.joints.values():
            top, T_top_parent = groups[joint.parent]
            fixed = joint.type == "fixed"
            groups[joint.child] = (top, T_top_parent @ joint.T_parent_joint) if fixed else (joint.child, np.eye(4))
        return groups

    def neighbours(self) -> set[frozenset[str]]:
        """Return the pairs of neighbouring links: joined by fixed joints and at most one moving joint.

        Collisions within these pairs are not simulated. Links of two arms are no neighbours, unless both are fixed."""
        arms = self.arms()
        tops = {link: top for link, (top, _) in self.rigid_groups().items()}
        adjacent = {frozenset((tops[joint.parent], tops[joint.child])) for joint in self.joints.values()}
        pairs = combinations(tops.items(), 2)
        return {
            frozenset((a, b))
            for (a, top_a), (b, top_b) in pairs
            if top_a == top_b or ({top_a, top_b} in adjacent and not _differ(arms, a, b))
        }

    def arms(self) -> dict[str, str]:
        """Return the first link of the arm to which each link belongs; links of no arm are left out.

        Several arms are subtrees of a root link `world` that have a moving joint. Any other robot has no such arms.
        """
        below: dict[str, list[Joint]] = {}
        first: dict[str, str] = {}
        for joint in self.joints.values() if self.root == WORLD else ():
            first[joint.child] = first.get(joint.parent, joint.child)
            below.setdefault(first[joint.child], []).append(joint)
        moving = {link for link, joints in below.items() if any(joint.type != "fixed" for joint in joints)}
        return {link: arm for link, arm in first.items() if arm in moving} if len(moving) > 1 else {}

    def apart(self, a: str, b: str) -> bool:
        """Return True if two links belong to different arms."""
        return _differ(self.arms(), a, b)

    def near(self, link: str) -> list[str]:
        """Return a link and its neighbours, e.g. a hand and its fingers; what grips it does not collide with them."""
        neighbours = self.neighbours()
        return [other for other in self.links if other == link or {link, other} in neighbours]


def _differ(arms: Mapping[str, str], a: str, b: str) -> bool:
    return a in arms and b in arms and arms[a] != arms[b]
