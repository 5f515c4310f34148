"""Serial chain of moving joints from a URDF; the inertia of everything fixed to a link is added to the link.

Independent of KDL and of physics engines; `kdl_chain` converts the result for KDL.
"""

from dataclasses import dataclass, replace

import numpy as np

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, MassProperties
from hric_core.urdf import Robot, read

MOVING_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
"""Kind of motion, revolute or prismatic, of the URDF joint types with one degree of freedom."""

Inertial = MassProperties
"""Former name of MassProperties, up to version 0.1; kept for importers."""


@dataclass(frozen=True)
class ChainSegment:
    """Moving joint and the link behind it; the link frame is the joint frame, moved by the joint.

    Attributes:
        joint, link: URDF names.
        kind: "revolute" or "prismatic".
        T_parent_joint: pose of the joint frame at zero in the frame of the previous moving link (the root for the
            first), shape (4, 4).
        axis: unit vector in the joint frame, shape (3,).
        inertial: mass properties of the link and everything rigidly attached to it, in the link frame.
    """

    joint: str
    link: str
    kind: str
    T_parent_joint: FloatArray
    axis: FloatArray
    inertial: MassProperties


@dataclass(frozen=True)
class SerialChain:
    """Chain of moving joints from root to tip.

    Attributes:
        root, tip: URDF link names.
        segments: from root to tip, one per moving joint.
        T_last_tip: pose of the tip link in the frame of the last moving link, shape (4, 4).
        tip_inertial: mass properties of the tip link and everything fixed to it further out, in the tip frame; they are
            also part of the last segment.
        T_world_root: pose of the root in the URDF's first link through fixed joints, shape (4, 4); None if a joint
            moves the root.
        frozen_joints: movable joints of side branches (fingers), treated as fixed at zero.
    """

    root: str
    tip: str
    segments: tuple[ChainSegment, ...]
    T_last_tip: FloatArray
    tip_inertial: MassProperties
    T_world_root: FloatArray | None
    frozen_joints: tuple[str, ...]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the moving joints from root to tip."""
        return tuple(segment.joint for segment in self.segments)

    def with_load(self, load: MassProperties) -> "SerialChain":
        """Return the same chain with `load` (in the tip frame) attached to the tip."""
        last = self.segments[-1]
        heavier = replace(last, inertial=last.inertial + load.moved(self.T_last_tip))
        return replace(self, segments=(*self.segments[:-1], heavier))


def parse_chain(urdf_xml: str, root: str, tip: str) -> SerialChain:
    """Return the chain of moving joints from link `root` to link `tip` of a URDF text.

    Raises:
        DescriptionError, UnknownNameError: the URDF has no such chain.
    """
    return chain_of(read(urdf_xml), root, tip)


def chain_of(robot: Robot, root: str, tip: str) -> SerialChain:
    """Return the chain of moving joints from link `root` to link `tip` of a robot description.

    Fixed joints on the path are folded into the transforms; links and branches fixed to the path are added to the
    inertia of the moving links. Bodies fixed to the root do not affect the dynamics and are left out.

    Raises:
        DescriptionError: there is no such path, a joint on it has more than one degree of freedom, or none moves.
        UnknownNameError: a link does not exist.
    """
    return _Builder(robot, root, tip).build()


class _Builder:
    """Builder of a `SerialChain`, which follows the path from root to tip and collects segments."""

    def __init__(self, robot: Robot, root: str, tip: str) -> None:
        self.robot, self.root, self.tip, self.path = robot, root, tip, robot.path(root, tip)
        self.segments: list[ChainSegment] = []
        self.frozen: list[str] = []

    def build(self) -> SerialChain:
        T = np.eye(4)  # pose of the present link in the frame of the last moving link
        for here, joint in enumerate(self.path):
            T = T @ joint.T_parent_joint
            if joint.type in MOVING_KINDS:
                self.segments.append(
                    ChainSegment(joint.name, joint.child, MOVING_KINDS[joint.type], T, joint.axis, MassProperties())
                )
                T = np.eye(4)
            elif joint.type != "fixed":
                valid = ", ".join(("fixed", *MOVING_KINDS))
                raise DescriptionError(
                    f"joint {joint.name} between {self.root} and {self.tip} is {joint.type}; valid: {valid}"
                )
            self._weld(joint.child, self.path[here + 1].name if here + 1 < len(self.path) else None, T)
        if not self.segments:
            raise DescriptionError(f"no moving joint between {self.root} and {self.tip}")
        tip_inertial = self._branch(self.tip, None, np.eye(4))
        return SerialChain(
            self.root,
            self.tip,
            tuple(self.segments),
            T,
            tip_inertial,
            self._mounting(),
            tuple(dict.fromkeys(self.frozen)),
        )

    def _branch(self, link: str, onward: str | None, T: FloatArray) -> MassProperties:
        """Return the mass properties of a link and of all links behind it, except those behind the joint `onward`.

        T: pose of the link in the frame of the result.
        """
        total = self._mass(link).moved(T)
        for joint, T_child in self.robot.beyond(link, T, onward):
            total = total + self._mass(joint.child).moved(T_child)
            if joint.type != "fixed":
                self.frozen.append(joint.name)
        return total

    def _mass(self, link: str) -> MassProperties:
        return self.robot.links[link].mass or MassProperties()

    def _weld(self, link: str, onward: str | None, T: FloatArray) -> None:
        """Add the mass of a link on the path, and of its side branches, to the last moving link.

        Args:
            link: name of the link.
            onward: name of the next joint on the path, whose child is left out; None: there is none.
            T: pose of the link in the frame of the last moving link.
        """
        if self.segments:
            last = self.segments[-1]
            self.segments[-1] = replace(last, inertial=last.inertial + self._branch(link, onward, T))

    def _mounting(self) -> FloatArray | None:
        mounting = self.robot.path(self.robot.root, self.root)
        if any(joint.type != "fixed" for joint in mounting):
            return None
        T = np.eye(4)
        for joint in reversed(mounting):
            T = joint.T_parent_joint @ T
        return T
