"""Skeleton in the scene of the emulated cameras: bones and labelled markers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hric_core.errors import ParameterError
from hric_core.geometry.poses import Pose, from_z_up
from hric_core.geometry.quaternions import Vector
from mocap_natnet.codec import descriptions as d

NO_BONE = 0
"""Parent number of a root bone; bones are numbered from 1 on."""


@dataclass(frozen=True)
class Bone:
    """Bone of a skeleton.

    Args:
        name: name of the bone in the description.
        parent: name of the parent bone; "": none.
        offset: offset of the bone's origin in axes of the parent, z up [m].
    """

    name: str
    parent: str = ""
    offset: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class ServedSkeleton:
    """Skeleton in the scene of the emulated cameras, with the source of its motion.

    Args:
        name: name in the description, also of its set of markers.
        id: streaming id, 1 to 32767.
        bones: bones, each after its parent.
        markers: names of the markers.
        source: function from stream time [s] to poses of the bones and positions of the markers, z up [m].
    """

    name: str
    id: int
    bones: tuple[Bone, ...]
    markers: tuple[str, ...]
    source: Callable[[float], tuple[Sequence[Pose], Sequence[Vector]]]

    def __post_init__(self) -> None:
        known = [""]
        for bone in self.bones:
            if bone.parent not in known:
                raise ParameterError(
                    f"bone {bone.name!r} of {self.name} has the parent {bone.parent!r}; valid: a bone listed before it"
                )
            known.append(bone.name)

    def described(self, up: str) -> d.SkeletonDescription:
        """Return the description of the skeleton; up: axis of the stream that points up."""
        numbers = {bone.name: number for number, bone in enumerate(self.bones, 1)}
        return d.SkeletonDescription(
            self.name,
            self.id,
            tuple(
                d.RigidBodyDescription(
                    bone.name, numbers[bone.name], numbers.get(bone.parent, NO_BONE), from_z_up(up, bone.offset)
                )
                for bone in self.bones
            ),
        )
