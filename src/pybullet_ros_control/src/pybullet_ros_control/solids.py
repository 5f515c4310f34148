"""Collision shapes of the engine's bodies, as the sides of them are asked for."""

from __future__ import annotations

import numpy as np
import pybullet

from hric_control.plants.faces import Solid
from hric_control.plants.spatial import FloatArray, rotation_from_quaternion
from pybullet_ros_control.engine import Body


def solids(body: Body, index: int, client: int) -> list[Solid]:
    """Shapes of an engine link, in the frame of its centre of mass. A mesh beside other shapes is left out: the engine does not tell its corners."""
    data = pybullet.getCollisionShapeData(body.id, index, physicsClientId=client)
    found = []
    for shape in data:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation_from_quaternion(shape[6]), shape[5]
        solid = _solid(shape[2], shape[3], T)
        if solid is None and shape[2] == pybullet.GEOM_MESH and len(data) == 1:
            count, corners = pybullet.getMeshData(body.id, index, physicsClientId=client)
            solid = Solid("hull", (), np.eye(4), np.array(corners)) if count > 0 else None
        if solid is not None:
            found.append(solid)
    return found


def _solid(kind: int, size: tuple[float, ...], T: FloatArray) -> Solid | None:
    if kind == pybullet.GEOM_SPHERE:
        return Solid("sphere", size[:1], T)
    if kind == pybullet.GEOM_BOX:
        return Solid("box", size, T)
    if kind == pybullet.GEOM_CAPSULE:
        return Solid("capsule", (size[1], size[0]), T)
    if kind == pybullet.GEOM_CYLINDER:
        return Solid("cylinder", (size[1], size[0]), T)
    return Solid("plane", (), T) if kind == pybullet.GEOM_PLANE else None
