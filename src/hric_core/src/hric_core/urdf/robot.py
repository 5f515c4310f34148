"""The tree of a description: links, and joints from the root outwards."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from xml.etree.ElementTree import Element

import numpy as np

from hric_core.errors import DescriptionError, check_known
from hric_core.geometry import FloatArray, MassProperties
from hric_core.urdf.shapes import Shape

ONE_COORDINATE = ("revolute", "continuous", "prismatic")
JOINT_TYPES = (*ONE_COORDINATE, "planar", "floating", "fixed")
BOUNDED = ("revolute", "prismatic")
NO_LIMIT = 1e4
"""A range that ends beyond this has no end there [rad or m]: descriptions write 1e16 and the like.
Default chosen by this project, unconfirmed."""


@dataclass(frozen=True)
class Limit:
    """A `<limit>` as written: lower and upper end [rad or m], largest effort [N m or N] and velocity [rad/s or m/s].

    None: there is no such attribute.
    """

    lower: float = 0.0
    upper: float = 0.0
    effort: float | None = None
    velocity: float | None = None


@dataclass(frozen=True)
class SafetyController:
    """A `<safety_controller>` as written, with ros_control's meaning."""

    k_velocity: float
    k_position: float = 0.0
    soft_lower: float = 0.0
    soft_upper: float = 0.0


@dataclass(frozen=True)
class Mimic:
    """q = multiplier * q of `joint` + offset [rad or m]."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint of the description.

    Attributes:
        type: one of JOINT_TYPES; what follows `axis` is only read for types with one coordinate.
        T_parent_joint: pose of the joint (and child) frame at q = 0 in the parent link, shape (4, 4) [m].
        axis: unit vector in the joint frame, shape (3,).
        limit: as written; `lower`, `upper`, `effort` and `velocity` are what it means.
        damping: viscous friction [N m s/rad or N s/m].
        friction: Coulomb friction [N m or N].
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

    @property
    def lower(self) -> float:
        """End of the range [rad or m]: infinite without one, -NO_LIMIT where only the upper end is one."""
        if self._unbounded or self.limit is None:
            return -math.inf
        return max(self.limit.lower, -NO_LIMIT)

    @property
    def upper(self) -> float:
        """The other end [rad or m]."""
        if self._unbounded or self.limit is None:
            return math.inf
        return min(self.limit.upper, NO_LIMIT)

    @property
    def _unbounded(self) -> bool:
        limit = self.limit
        return self.type not in BOUNDED or (limit is not None and limit.lower <= -NO_LIMIT and limit.upper >= NO_LIMIT)

    @property
    def effort(self) -> float:
        """Largest effort [N m or N]; infinite without one, and where it is zero."""
        return (self.limit.effort if self.limit else None) or math.inf

    @property
    def velocity(self) -> float:
        """Largest velocity [rad/s or m/s]; infinite without one, and where it is not above zero."""
        velocity = (self.limit.velocity if self.limit else None) or 0.0
        return velocity if velocity > 0.0 else math.inf


def mimic_laws(joints: Mapping[str, Joint]) -> dict[str, Mimic]:
    """Law of each joint that mimics another, by name; its `joint` is the end of the chain, which mimics none."""
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
    """A link of the description.

    Attributes:
        mass: in axes of the link; None without `<inertial>`.
    """

    name: str
    mass: MassProperties | None
    visuals: tuple[Shape, ...] = ()
    collisions: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class Robot:
    """A description: links in document order, joints by name from the root outwards.

    Attributes:
        root: the link that is nobody's child.
        element: of the document, for what this tree does not hold (transmissions, plugins).
    """

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    element: Element = field(repr=False, compare=False)

    def check_link(self, name: str) -> None:
        """Raises UnknownNameError where there is no such link."""
        check_known("link", [name], self.links, f"robot {self.name}")

    def check_actuated(self, names: Sequence[str]) -> None:
        """Refuse joints that nothing can drive by themselves.

        Raises:
            UnknownNameError: no such moving joint.
            DescriptionError: there is none, or one that mimics another joint.
        """
        if not names:
            raise DescriptionError(f"robot {self.name}: no joint to drive; give at least one a <transmission>")
        moving = [joint.name for joint in self.joints.values() if joint.type != "fixed"]
        check_known("moving joint", names, moving, f"robot {self.name}")
        for mimic, name in ((self.joints[name].mimic, name) for name in names):
            if mimic is not None:
                raise DescriptionError(
                    f"joint {name}: it mimics {mimic.joint} and cannot be driven by itself; remove its <transmission>, "
                    "or its <mimic>"
                )

    def path(self, root: str, tip: str) -> list[Joint]:
        """Joints from link `root` out to link `tip`.

        Raises:
            UnknownNameError: no such link.
            DescriptionError: the tip does not hang on the root.
        """
        self.check_link(root)
        self.check_link(tip)
        above = {joint.child: joint for joint in self.joints.values()}
        joints: list[Joint] = []
        link = tip
        while link != root:
            if link not in above:
                raise DescriptionError(f"link {tip} does not hang on link {root} in the description of {self.name}")
            joints.insert(0, above[link])
            link = above[link].parent
        return joints

    def beyond(
        self, link: str, T: FloatArray | None = None, without: str | None = None
    ) -> Iterator[tuple[Joint, FloatArray]]:
        """Joints further out than a link, depth first, with the pose of their child where all are at zero, shape (4, 4)
        [m].

        Args:
            link: where to start.
            T: its pose in the frame of the result; None: the link's own.
            without: a joint that is left out, with all beyond it.
        """
        T_link = {link: np.eye(4) if T is None else T}
        for joint in self.joints.values():
            if joint.parent in T_link and joint.name != without:
                T_link[joint.child] = T_link[joint.parent] @ joint.T_parent_joint
                yield joint, T_link[joint.child]

    def rigid_groups(self) -> dict[str, tuple[str, FloatArray]]:
        """For each link the topmost one that it is fixed to, and its pose in that, shape (4, 4) [m]."""
        groups = {self.root: (self.root, np.eye(4))}
        for joint in self.joints.values():
            top, T_top_parent = groups[joint.parent]
            fixed = joint.type == "fixed"
            groups[joint.child] = (top, T_top_parent @ joint.T_parent_joint) if fixed else (joint.child, np.eye(4))
        return groups

    def neighbours(self) -> set[frozenset[str]]:
        """Pairs of links that never touch each other: between them are fixed joints only, or one joint that moves."""
        tops = {link: top for link, (top, _) in self.rigid_groups().items()}
        adjacent = {frozenset((tops[joint.parent], tops[joint.child])) for joint in self.joints.values()}
        pairs = combinations(tops.items(), 2)
        return {frozenset((a, b)) for (a, top_a), (b, top_b) in pairs if top_a == top_b or {top_a, top_b} in adjacent}

    def near(self, link: str) -> list[str]:
        """A link and its neighbours: what a grip on it does not collide with, as the fingers beside a hand."""
        neighbours = self.neighbours()
        return [other for other in self.links if other == link or {link, other} in neighbours]
