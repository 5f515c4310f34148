"""OpenSim joints for URDF joints; joint frames are rotated so that OpenSim's fixed axes lie along the URDF's axes."""

import math

import numpy as np
import opensim

from hric_core.geometry import FloatArray, homogeneous
from hric_core.geometry.transforms import rotation_onto
from hric_core.urdf import Joint
from urdf_to_osim import transforms

PLANAR = ("theta", "x", "y")
FLOATING = ("rx", "ry", "rz", "tx", "ty", "tz")
# Range of the coordinate sliders in OpenSim's GUI if the description sets no limit: angle [rad], and length [m].
# Project default, unconfirmed.
FREE_ANGLE, FREE_LENGTH = 2.0 * math.pi, 10.0
_CLASSES = {
    "fixed": opensim.WeldJoint,
    "revolute": opensim.PinJoint,
    "continuous": opensim.PinJoint,
    "prismatic": opensim.SliderJoint,
    "planar": opensim.PlanarJoint,
    "floating": opensim.FreeJoint,
}


def joint_rotation(joint: Joint) -> FloatArray:
    """Return the rotation of OpenSim's joint frame in the URDF joint frame, shape (3, 3), which aligns the axes.

    OpenSim's PinJoint rotates about z, its SliderJoint moves along x, its PlanarJoint moves along x and y and rotates
    about z.
    """
    if joint.type in ("revolute", "continuous", "planar"):
        return rotation_onto(2, joint.axis)
    if joint.type == "prismatic":
        return rotation_onto(0, joint.axis)
    return np.eye(3)


def coordinate_names(joint: Joint, name: str) -> tuple[str, ...]:
    """Return the names of a joint's coordinates in the OpenSim model, in order; name: name of the OpenSim joint.

    A joint with one coordinate: <name>. A planar joint: <name>_theta [rad], <name>_x, <name>_y [m] in the plane. A
    floating joint: <name>_rx, _ry, _rz (body-fixed x-y-z angles [rad]), _tx, _ty, _tz (position in the joint frame
    [m]). A fixed joint has none.
    """
    if joint.type == "fixed":
        return ()
    suffixes = {"planar": PLANAR, "floating": FLOATING}.get(joint.type)
    return (name,) if suffixes is None else tuple(f"{name}_{suffix}" for suffix in suffixes)


def build(
    joint: Joint, name: str, parent: opensim.PhysicalFrame, T_frame_parent: FloatArray, child: opensim.Body
) -> opensim.Joint:
    """Return an OpenSim joint for a joint of the description.

    Args:
        joint: joint of the description.
        name: name of the OpenSim joint.
        parent: OpenSim body (or ground) to which the parent link belongs.
        T_frame_parent: pose of the parent link in that body, shape (4, 4) [m].
        child: OpenSim body of the child link.
    """
    A = homogeneous(joint_rotation(joint))
    made = _CLASSES[joint.type](
        name, parent, *transforms.offset(T_frame_parent @ joint.T_parent_joint @ A), child, *transforms.offset(A)
    )
    for index, coordinate in enumerate(coordinate_names(joint, name)):
        _set_up(made.upd_coordinates(index), coordinate, joint, index)
    return made


def default_value(joint: Joint) -> float:
    """Return the default value of a joint's coordinate [rad or m]: zero, or the end of its range nearest to zero."""
    return min(max(0.0, joint.lower), joint.upper)


def _set_up(coordinate: opensim.Coordinate, name: str, joint: Joint, index: int) -> None:
    rotation = (
        joint.type in ("revolute", "continuous")
        or (joint.type == "planar" and index == 0)
        or (joint.type == "floating" and index < 3)
    )
    free = FREE_ANGLE if rotation else FREE_LENGTH
    coordinate.setName(name)
    coordinate.setRangeMin(max(joint.lower, -free) if math.isinf(joint.lower) else joint.lower)
    coordinate.setRangeMax(min(joint.upper, free) if math.isinf(joint.upper) else joint.upper)
    coordinate.setDefaultValue(default_value(joint))
    coordinate.setDefaultClamped(False)
