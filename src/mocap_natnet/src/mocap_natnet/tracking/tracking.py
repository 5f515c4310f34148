"""Tracker: converts mocap frames to named bodies and markers in the published axes."""

from collections.abc import Collection, Hashable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from hric_core.geometry import Pose, Vector, compose, normalized, transformed
from hric_core.geometry.poses import pose_from_z_up, pose_z_up, z_up
from mocap_natnet.codec.descriptions import MarkerSetDescription, RigidBodyDescription, ServerModel, SkeletonDescription
from mocap_natnet.codec.types import OCCLUDED, TRACKED, Frame, Marker, RigidBody
from mocap_natnet.tracking.validity import PoseValidator

FAR = 1e6
"""Largest valid coordinate of a marker [m] (project default, unconfirmed)."""
MAX_NAMES = 500
"""Largest number of bodies and bones that are published by name (project default, unconfirmed).

Each needs a topic or a tf frame, and damaged descriptions may contain new names in each frame.
"""


class TrackedBody(NamedTuple):
    """Rigid body as published; if tracking is not valid, the pose is the last valid one."""

    name: str
    id: int
    pose: Pose
    valid: bool
    mean_error: float


class TrackedMarker(NamedTuple):
    """Visible labelled marker; its name is "body/marker", or "" if the description has no name."""

    name: str
    id: int
    position: Vector
    size: float


@dataclass
class Tracker:
    """Tracker that transforms, names and validates the contents of a frame.

    Args:
        up: axis that points up in the stream, y or z.
        base_from_mocap: pose of the mocap frame (z up) in the robot's base, by which positions and orientations are
            transformed; None: they stay in the axes of the stream.
        validator: validator of the poses, in the mocap frame with z up.

    Attributes:
        lost: number of times that the tracking of a body ended, by name.
    """

    up: str
    base_from_mocap: Pose | None
    validator: PoseValidator
    lost: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._described: dict[int, RigidBodyDescription] = {}
        self._bones: dict[tuple[int, int], str] = {}
        self._skeleton_markers: dict[int, tuple[str, tuple[str, ...]]] = {}
        self._last: dict[int, Pose] = {}
        self._valid: dict[int, bool] = {}
        self._names: set[Hashable] = set()
        self._marker_names: dict[int, str] = {}

    def describe(self, model: ServerModel) -> None:
        """Store the names of bodies, bones and markers in the server's description."""
        self._described = model.bodies
        self._marker_names = {}
        skeletons = [description for description in model.descriptions if isinstance(description, SkeletonDescription)]
        sets = {
            description.name: description.markers
            for description in model.descriptions
            if isinstance(description, MarkerSetDescription)
        }
        self._skeleton_markers = {
            description.id: (description.name, sets.get(description.name, ())) for description in skeletons
        }
        self._bones = {
            (skeleton.id, bone.id & 0xFFFF): f"{skeleton.name}/{bone.name}"
            for skeleton in skeletons
            for bone in skeleton.bodies
        }

    def restart(self) -> None:
        """Forget the state of the tracked bodies, because another stream begins.

        The last positions still limit which poses are valid, since bodies move continuously and times are by the clock
        of this machine.
        """
        self._last.clear()
        self._valid.clear()

    def name(self, body: int) -> str:
        """Return the name of the body with this streaming id, or "body_<id>" if the server has not described it."""
        described = self._described.get(body)
        return described.name if described and described.name else f"body_{body}"

    def bodies(self, frame: Frame, exposed: float, received: float) -> list[TrackedBody]:
        """Return the rigid bodies of a frame; with a description, bodies missing in it are left out and counted.

        Args:
            frame: decoded frame.
            exposed: time of the exposure [s].
            received: time of the arrival [s].
        """
        named = [(body, self.name(body.id)) for body in frame.bodies]
        return [
            self._body(body, name, exposed, received)
            for body, name in named
            if self._known(body.id, self._described, name)
        ]

    def _known(self, id: Hashable, described: Collection[Any], name: str) -> bool:
        """Return True if a body or bone is to be published; otherwise count the reason why not."""
        if described and id not in described:
            reason = "not described"
        elif (id, name) in self._names:
            return True
        elif len(self._names) < MAX_NAMES:
            self._names.add((id, name))
            return True
        else:
            reason = "too many bodies"
        self.validator.refused[reason] += 1
        return False

    def markers(self, frame: Frame) -> list[TrackedMarker]:
        """Return the labelled markers of a frame that are visible and have a finite position."""
        return [
            self._marker(marker) for marker in frame.markers if not marker.flags & OCCLUDED and _near(marker.position)
        ]

    def bones(self, frame: Frame) -> list[tuple[str, Pose]]:
        """Return ("skeleton/bone", pose) of each tracked bone with a pose; Motive must stream global coordinates."""
        poses = []
        for skeleton in frame.skeletons:
            for bone in skeleton.bodies:
                pose = pose_z_up(self.up, Pose(bone.position, bone.orientation))
                number = (skeleton.id, bone.id & 0xFFFF)
                name = self._bones.get(number, f"skeleton_{skeleton.id}/bone_{number[1]}")
                if bone.flags & TRACKED and self._known(number, self._bones, name) and self.validator.possible(pose):
                    exact = Pose(pose.position, normalized(pose.orientation))
                    base = self.base_from_mocap
                    poses.append((name, pose_from_z_up(self.up, exact) if base is None else compose(base, exact)))
        return poses

    def _body(self, body: RigidBody, name: str, exposed: float, received: float) -> TrackedBody:
        pose = None
        if body.flags & TRACKED:
            pose = self.validator.accept(
                body.id, pose_z_up(self.up, Pose(body.position, body.orientation)), exposed, received
            )
        if pose is not None:
            base = self.base_from_mocap
            self._last[body.id] = pose_from_z_up(self.up, pose) if base is None else compose(base, pose)
        elif self._valid.get(body.id):
            self.lost[name] = self.lost.get(name, 0) + 1
        self._valid[body.id] = pose is not None
        return TrackedBody(name, body.id, self._last.get(body.id, Pose()), pose is not None, body.mean_error)

    def _marker(self, marker: Marker) -> TrackedMarker:
        name = self._marker_names.get(marker.id)
        if name is None:
            name = self._marker_name(marker.id)
            if name:  # undescribed ids are not stored: there may be any number of them
                self._marker_names[marker.id] = name
        base = self.base_from_mocap
        position = marker.position if base is None else transformed(base, z_up(self.up, marker.position))
        return TrackedMarker(name, marker.id, position, marker.size)

    def _marker_name(self, marker: int) -> str:
        body, member = marker >> 16, marker & 0xFFFF
        described = self._described.get(body)
        if described and 1 <= member <= len(described.markers):
            return f"{described.name}/{described.markers[member - 1].name or member}"
        skeleton, names = self._skeleton_markers.get(body, ("", ()))
        return f"{skeleton}/{names[member - 1]}" if described is None and 1 <= member <= len(names) else ""


def _near(position: Vector) -> bool:
    """Return True if a position is finite, and each coordinate below FAR."""
    x, y, z = position
    return -FAR < x < FAR and -FAR < y < FAR and -FAR < z < FAR
