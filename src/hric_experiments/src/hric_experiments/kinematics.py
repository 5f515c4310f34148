"""Where the tip of a chain was in each cycle: forward kinematics of a whole control log at once. No ROS."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from hric_control import urdf
from hric_control.errors import DescriptionError
from hric_experiments.bag_reader import ControlRecord

FloatArray = npt.NDArray[np.float64]


def positions(description: str, log: ControlRecord, base: str, tip: str, p_tip: FloatArray) -> FloatArray:
    """Positions of a point of the tip in the base in each cycle, shape (n, 3) [m].

    Args:
        description: URDF.
        log: positions of the joints; those that it does not have stand at 0.
        base, tip: names of links.
        p_tip: the point in the tip's frame, shape (3,) [m].

    Raises:
        DescriptionError: the tip does not hang on the base.
    """
    R = np.broadcast_to(np.eye(3), (log.cycles, 3, 3))
    p = np.zeros((log.cycles, 3))
    for joint in _chain(urdf.parse(description), base, tip):
        origin = joint.find("origin")
        xyz, rpy = (np.zeros(3), np.zeros(3)) if origin is None else (_vector(origin.get(key, "0 0 0")) for key in ("xyz", "rpy"))
        p, R = p + R @ xyz, R @ Rotation.from_euler("xyz", rpy).as_matrix()
        if joint.get("name") in log.joint_names:
            q = log.position[:, [log.joint_names.index(joint.get("name", ""))]]
            element = joint.find("axis")
            axis = _vector("1 0 0" if element is None else element.get("xyz", "1 0 0"))
            if joint.get("type") == "prismatic":
                p = p + np.einsum("nij,nj->ni", R, q * axis)
            else:
                R = R @ Rotation.from_rotvec(q * axis).as_matrix()
    return p + R @ p_tip


def _vector(text: str) -> FloatArray:
    return np.array([float(part) for part in text.split()])


def _chain(robot: ElementTree.Element, base: str, tip: str) -> list[ElementTree.Element]:
    """The joints from the base to the tip."""
    above = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}  # type: ignore[union-attr]
    found: list[ElementTree.Element] = []
    link: str | None = tip
    while link != base:
        if link not in above:
            raise DescriptionError(f"link {tip} does not hang on {base} in the robot description")
        found.insert(0, above[link])
        link = above[link].find("parent").get("link")  # type: ignore[union-attr]
    return found
