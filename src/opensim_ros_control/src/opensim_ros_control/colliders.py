"""The colliders of a model and the pairs of them that may touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hric_control.plants.masks import masked
from hric_control.plants.spatial import FloatArray
from opensim_ros_control.collision import Collider, bounded
from opensim_ros_control.engine import Engine
from opensim_ros_control.kinematics import Kinematics
from opensim_ros_control.shapes import Shape
from urdf_to_osim import urdf


def moved_by(description: urdf.Robot, link: str, reach: float, places: Mapping[str, Sequence[int]], nq: int) -> FloatArray:
    """How far a point of a link goes at the most per change of each coordinate, shape (nq,).

    Args:
        link: of the description.
        reach: distance of the point from the link's origin [m].
        places: where each moving joint's coordinates stand in q; of a floating joint three angles first, of a planar one an angle.
        nq: number of coordinates.
    """
    result = np.zeros(nq)
    above = {joint.child: joint for joint in description.joints.values()}
    while link in above:
        joint = above[link]
        angles = {"floating": 3, "planar": 1, "prismatic": 0, "fixed": 0}.get(joint.type, 1)
        for i, place in enumerate(places.get(joint.name, ())):
            result[place] = reach if i < angles else 1.0
        free = {"floating": np.inf, "planar": np.inf, "prismatic": max(abs(joint.lower), abs(joint.upper))}.get(joint.type, 0.0)
        reach = bounded(reach + float(np.linalg.norm(joint.T_parent_joint[:3, 3])) + float(free))
        link = joint.parent
    return result


def make(
    description: urdf.Robot,
    shapes: Mapping[str, Sequence[Shape]],
    engine: Engine,
    kinematics: Kinematics,
    places: Mapping[str, Sequence[int]],
    robot: str,
) -> list[Collider]:
    """Colliders of all links that have shapes.

    Args:
        description: of all that stands in the model.
        shapes: by link of the description.
        places: see `moved_by`.
        robot: name of the robot's model, to which links without "model::" belong.
    """
    result = []
    nq = engine.nu
    for link, of_link in shapes.items():
        number, T_body_link = kinematics.carrier(engine.frames[link])
        model = link.partition("::")[0] if "::" in link else robot
        for shape in of_link:
            reach = moved_by(description, link, shape.radius, places, nq)
            full = link if "::" in link else f"{robot}::{link}"
            result.append(Collider(full, model, shape, number, T_body_link @ shape.T_link_shape, reach))
    return result


def _groups(description: urdf.Robot) -> dict[str, str]:
    """For each link the topmost one that it is fixed to."""
    top = {description.root: description.root}
    for joint in description.joints.values():
        top[joint.child] = top[joint.parent] if joint.type == "fixed" else joint.child
    return top


def pairs(
    description: urdf.Robot, colliders: Sequence[Collider], robot: str, masks: Sequence[tuple[str, str]], self_collision: bool
) -> list[tuple[Collider, Collider]]:
    """Pairs that may touch: of different models; of the robot's links those that are neither fixed to each other, nor neighbours, nor masked."""
    top = _groups(description)
    name = {link if "::" in link else f"{robot}::{link}": link for link in description.links}
    joined = {frozenset((joint.parent, joint.child)) for joint in description.joints.values()}
    joined |= {frozenset((top[joint.parent], joint.child)) for joint in description.joints.values()}
    result = []
    for i, a in enumerate(colliders):
        for b in colliders[i + 1 :]:
            link_a, link_b = name[a.link], name[b.link]
            if top[link_a] == top[link_b]:
                continue
            if a.model == b.model and (
                a.model != robot or not self_collision or frozenset((link_a, link_b)) in joined or masked(link_a, link_b, masks)
            ):
                continue
            result.append((a, b))
    return result
