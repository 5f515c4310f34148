"""Collision shapes of a robot description for coal (the collision library of pinocchio), and contact of two shapes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import coal
import numpy as np

from hric_control.plants.faces import Solid
from hric_core.geometry import FloatArray
from hric_core.meshes.canonical import hull_of
from hric_core.urdf import Shape as Described
from hric_core.urdf import solids
from hric_core.urdf.shapes import FAR

_POINT = 1e-6
"""Radius of the sphere that represents a point in coal [m]; any small value is suitable."""


@dataclass(frozen=True)
class LinkShape:
    """Collision shape of a link.

    Attributes:
        geometry: the shape as coal's geometry object.
        T_link_shape: pose in the link, shape (4, 4).
        radius: radius of a sphere about the link's origin that contains the shape [m].
        solid: the shape in its own frame, for the computation of contact areas.
    """

    geometry: Any
    T_link_shape: FloatArray
    radius: float
    solid: Solid


@lru_cache(maxsize=64)
def _convex(corners: bytes) -> Any:
    points = coal.StdVec_Vec3s()
    for point in np.frombuffer(corners).reshape(-1, 3):
        points.append(point)
    try:
        return coal.ConvexBase.convexHull(points, True, "Qt")
    except RuntimeError:  # a corner with more than 255 edges, as on a round lid; joggling (QJ) splits it
        return coal.ConvexBase.convexHull(points, True, "QJ")


MAKERS: dict[str, Callable[..., Any]] = {
    "box": coal.Box,
    "sphere": coal.Sphere,
    "cylinder": coal.Cylinder,
    "capsule": coal.Capsule,
}


def _geometry(shape: Described) -> Any:
    return _convex(hull_of(shape).vertices.tobytes()) if shape.kind == "mesh" else MAKERS[shape.kind](*shape.size)


def shapes(collisions: Sequence[Described]) -> list[LinkShape]:
    """Return the collision shapes of a link for coal.

    A cylinder with spheres at its ends becomes one capsule, a mesh its convex hull.

    Raises:
        DescriptionError: a shape cannot be used.
    """
    result = []
    for shape in solids(collisions):
        geometry, T = _geometry(shape), shape.T_link_shape
        geometry.computeLocalAABB()
        centre = T[:3, :3] @ np.asarray(geometry.aabb_center) + T[:3, 3]
        result.append(
            LinkShape(geometry, T, float(np.linalg.norm(centre)) + float(geometry.aabb_radius), _solid(geometry))
        )
    return result


def _solid(geometry: Any) -> Solid:
    """Return a shape of coal as a solid for the computation of contact areas."""
    if isinstance(geometry, coal.Box):
        return Solid("box", tuple(2.0 * float(half) for half in geometry.halfSide), np.eye(4))
    if isinstance(geometry, coal.Sphere):
        return Solid("sphere", (float(geometry.radius),), np.eye(4))
    if isinstance(geometry, coal.Capsule | coal.Cylinder):
        kind = "capsule" if isinstance(geometry, coal.Capsule) else "cylinder"
        return Solid(kind, (float(geometry.radius), 2.0 * float(geometry.halfLength)), np.eye(4))
    return Solid("hull", (), np.eye(4), np.array(geometry.points()))


def plane() -> LinkShape:
    """Return a plane as a collision shape: the half-space below z = 0 of the link."""
    return LinkShape(coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), np.eye(4), FAR, Solid("plane", (), np.eye(4)))


def pose(T: FloatArray) -> Any:
    """Return a pose, shape (4, 4), as coal's transform object."""
    return coal.Transform3s(T[:3, :3], T[:3, 3])


@dataclass(frozen=True)
class Touch:
    """Contact or near contact of two shapes a and b.

    Attributes:
        points: centre of the overlap, a list of one point, shape (3,) [m].
        normal: unit vector from b to a.
        depth: depth of the deepest point, negative for a gap [m].
    """

    points: list[FloatArray]
    normal: FloatArray
    depth: float


class Pairing:
    """Distance and contact of two shapes by coal, whose request and result objects are reused.

    In all methods a, b are coal's geometries and T_a, T_b their transforms.

    Args:
        margin: distance below which a near contact is reported [m].
    """

    def __init__(self, margin: float) -> None:
        self._margin = margin
        self._distance, self._distance_request = coal.DistanceResult(), coal.DistanceRequest()
        self._distance_request.enable_signed_distance = True
        self._point = coal.Sphere(_POINT)
        self._result = coal.CollisionResult()
        self._request = coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, 1)
        self._request.security_margin = margin
        self._patch_request = coal.ContactPatchRequest()
        self._patch = coal.ContactPatchResult(self._patch_request)

    def distance(self, a: Any, T_a: Any, b: Any, T_b: Any) -> float:
        """Return the distance of two shapes [m], negative if they overlap."""
        self._distance.clear()
        return float(coal.distance(a, T_a, b, T_b, self._distance_request, self._distance))

    def touch(self, a: Any, T_a: Any, b: Any, T_b: Any) -> Touch | None:
        """Return the contact of two shapes; None if they are farther apart than the margin."""
        self._result.clear()
        if not coal.collide(a, T_a, b, T_b, self._request, self._result):
            return None
        contact = self._result.getContact(0)
        normal = -np.array(contact.normal)  # coal's normal goes from the first shape to the second
        if not normal.any():  # the axes of round shapes coincide: every direction across them is as short a way out
            normal = np.array((T_b if isinstance(a, coal.Sphere) else T_a).getRotation())[:, 0]
        return Touch([np.array(contact.pos)], normal, -float(contact.penetration_depth))

    def beyond(self, point: FloatArray, shape: Any, T: Any) -> float:
        """Return the distance of a point from a shape [m], negative inside."""
        self._distance.clear()
        at = coal.Transform3s(np.eye(3), point)
        return float(coal.distance(self._point, at, shape, T, self._distance_request, self._distance)) + _POINT

    def patch(self, a: Any, T_a: Any, b: Any, T_b: Any) -> list[FloatArray]:
        """Return the corners of the contact area of the two shapes of the last `touch`; empty if there are none."""
        self._patch.clear()
        coal.computeContactPatch(a, T_a, b, T_b, self._result, self._patch_request, self._patch)
        if self._patch.numContactPatches() == 0:
            return []
        patch = self._patch.getContactPatch(0)
        return [np.array(patch.getPoint(i)) for i in range(patch.size())]
