"""Tree of a description: links, and joints from the root outwards."""

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
"""Bound of a position limit [rad or m] beyond which there is no limit: descriptions write 1e16 and the like.

Project default, unconfirmed."""


@dataclass(frozen=True)
class Limit:
    """`<limit>` as written: lower, upper [rad or m], largest effort [N m or N] and velocity [rad/s or m/s].

    None: there is no such attribute.
    """

    lower: float = 0.0
    upper: float = 0.0
    effort: float | None = None
    velocity: float | None = None


@dataclass(frozen=True)
class SafetyController:
    """`<safety_controller>` as written, with ros_control's meaning."""

    k_velocity: float
    k_position: float = 0.0
    soft_lower: float = 0.0
    soft_upper: float = 0.0


@dataclass(frozen=True)
class Mimic:
    """Law of a mimic joint: q = multiplier * q of `joint` + offset [rad or m]."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """Joint of the description.

    Attributes:
        type: one of JOINT_TYPES; the attributes after `axis` are only read for types with one coordinate.
        T_parent_joint: pose of the joint (and child) frame at q = 0 in the parent link, shape (4, 4) [m].
        axis: unit vector in the joint frame, shape (3,).
        limit: as written; `lower`, `upper`, `effort` and `velocity` are its interpretation.
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
        """Lower end of the range [rad or m]; infinite without a range, -NO_LIMIT if only the upper end is a limit."""
        if self._unbounded or self.limit is None:
            return -math.inf
        return max(self.limit.lower, -NO_LIMIT)

    @property
    def upper(self) -> float:
        """Upper end of the range [rad or m]; infinite without a range, NO_LIMIT if only the lower end is a limit."""
        if self._unbounded or self.limit is None:
            return math.inf
        return min(self.limit.upper, NO_LIMIT)

    @property
    def _unbounded(self) -> bool:
        limit = self.limit
        return self.type not in BOUNDED or (limit is not None and limit.lower <= -NO_LIMIT and limit.upper >= NO_LIMIT)

    @property
    def effort(self) -> float:
        """Largest effort [N m or N]; infinite if it is missing or zero."""
        return (self.limit.effort if self.limit else None) or math.inf

    @property
    def velocity(self) -> float:
        """Largest velocity [rad/s or m/s]; infinite if it is missing or not above zero."""
        velocity = (self.limit.velocity if self.limit else None) or 0.0
        return velocity if velocity > 0.0 else math.inf


def mimic_laws(joints: Mapping[str, Joint]) -> dict[str, Mimic]:
    """Return the law of each mimic joint by name; its `joint` is the end of the chain, which mimics none."""
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
    """Link of the description.

    Attributes:
        mass: mass properties in axes of the link; None without `<inertial>`.
    """

    name: str
    mass: MassProperties | None
    visuals: tuple[Shape, ...] = ()
    collisions: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class Robot:
    """Robot description: links in document order, joints by name from the root outwards.

    Attributes:
        root: link without parent.
        element: element of the document, for content that this tree does not have (transmissions, plugins).
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
        """Refuse joints that cannot be driven.

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
        """Return the joints from link `root` out to link `tip`.

        Raises:
            UnknownNameError: no such link.
            DescriptionError: the tip is not below the root.
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
        """Yield the joints below a link, depth first, with the pose of their child at zero, shape (4, 4) [m].

        Args:
            link: link to start from.
            T: its pose in the frame of the result; None: the link's own.
            without: joint that is left out with its subtree.
        """
        T_link = {link: np.eye(4) if T is None else T}
        for joint in self.joints.values():
            if joint.parent in T_link and joint.name != without:
                T_link[joint.child] = T_link[joint.parent] @ joint.T_parent_joint
                yield joint, T_link[joint.child]

    def rigid_groups(self) -> dict[str, tuple[str, FloatArray]]:
        """Return for each link the topmost link to which it is fixed, and its pose in that, shape (4, 4) [m]."""
        groups = {self.root: (self.root, np.eye(4))}
        for joint in self.joints.values():
            top, T_top_parent = groups[joint.parent]
            fixed = joint.type == "fixed"
            groups[joint.child] = (top, T_top_parent @ joint.T_parent_joint) if fixed else (joint.child, np.eye(4))
        return groups

    def neighbours(self) -> set[frozenset[str]]:
        """Return the pairs of links without mutual contact: joined by fixed joints only, or by one moving joint."""
        tops = {link: top for link, (top, _) in self.rigid_groups().items()}
        adjacent = {frozenset((tops[joint.parent], tops[joint.child])) for joint in self.joints.values()}
        pairs = combinations(tops.items(), 2)
        return {frozenset((a, b)) for (a, top_a), (b, top_b) in pairs if top_a == top_b or {top_a, top_b} in adjacent}

    def near(self, link: str) -> list[str]:
        """Return a link and its neighbours, which a grip on it does not collide with, as the fingers next to a hand."""
        neighbours = self.neighbours()
        return [other for other in self.links if other == link or {link, other} in neighbours]
