"""Walking: the root link of a body is moved along a specified path, independently of the body's joints.

This is not a gait: the legs keep the posture of their reference. Two prismatic joints between the ground and the root
link move the person; a spring and a damper track the path, with feedforward of the force that accelerates the body. The
force of spring and damper is limited.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import Pose
from hric_core.parameters import Settings, listing, number, numbers, refused
from hric_core.urdf import write_inertial
from hric_human.body import Body
from hric_human.body.segments import ROOT
from hric_human.signals import RestToRest

GROUND, JOINTS = "human_ground", ("walk_x", "walk_y")
"""Root link of a walking body, and names of the joints from there to `human_base`, along x and y of the world."""
SHARE = 0.01
"""Mass of each link that the walking joints move, as share of the body's mass [1]; engines need one.

The constants of this file are project defaults, unconfirmed.
"""
STIFFNESS_RATE = 30.0
"""Natural frequency of the critically damped spring and damper that track the path [rad/s]."""
FASTEST = 12.5
"""Maximum accepted walking speed [m/s]; a sprinter reaches 12.3 m/s (IAAF, Berlin 2009)."""
REACH = 100.0
"""Maximum walking distance in each direction [m]."""


@dataclass(frozen=True)
class WalkSettings(Settings):
    """Settings of a person's walking path."""

    separator: ClassVar[str] = "."
    points: tuple[tuple[float, ...], ...] = listing(
        numbers(3),
        unit="s, m",
        text="[time since the start, x, y]: displacements in the world, with minimum-jerk motions from rest to rest "
        "between them; before the first time the person stands at the first point",
    )
    push: float = number(
        150.0, above=0.0, unit="N", text="maximum force with which the person stays on the path against obstacles"
    )

    def check(self, where: str) -> None:
        """Check that the times increase and that no speed exceeds `FASTEST`. Raises ParameterError."""
        times = [row[0] for row in self.points]
        if not times or times[0] < 0.0 or any(b <= a for a, b in pairwise(times)):
            raise ParameterError(
                f"{where}points must have one row or more, [time, x, y]; the times must increase, and be 0 s or later"
            )
        for (begin, *a), (end, *b) in pairwise(self.points):
            if (speed := 15 / 8 * math.dist(a, b) / (end - begin)) > FASTEST:
                name = f"{where}points: the speed after {begin:g} s"
                raise refused(name, f"{speed:.3g} m/s", f"up to {FASTEST:g} m/s")


class Walk:
    """Walking of one body: its path, the forces that track it, and the URDF with the walking joints.

    Args:
        settings: settings of the path.
        body: body that walks.
        heading: rotation of the root link in the world, about z [rad].

    Attributes:
        path: displacement along x and y of the world [m] as a function of the time since the motion's start.
        urdf: URDF of the body with the walking joints.
        start: displacement before the motion begins, 2 floats [m].
    """

    def __init__(self, settings: WalkSettings, body: Body, heading: float) -> None:
        times, *displacements = zip(*settings.points, strict=True)
        self.path, self._push = RestToRest(times, list(zip(*displacements, strict=True))), settings.push
        self._mass = body.total_mass * (1.0 + 2.0 * SHARE)
        self.urdf = _walking(body, heading)
        self.start = list(settings.points[0][1:])

    def force(self, since: float, q: Sequence[float], dq: Sequence[float]) -> list[float]:
        """Return the forces of the walking joints along x and y of the world, 2 floats [N].

        Args:
            since: time since the motion's start [s].
            q: displacements of the walking joints, 2 floats [m].
            dq: velocities of the walking joints, 2 floats [m/s].
        """
        (position, speed), acceleration = self.path.at(since), self.path.bend(since)
        k, c = self._mass * STIFFNESS_RATE**2, 2.0 * self._mass * STIFFNESS_RATE
        held = [k * (p - x) + c * (v - w) for p, x, v, w in zip(position, q, speed, dq, strict=True)]
        size = math.hypot(*held)
        share = min(1.0, self._push / size) if size > 0.0 else 1.0
        return [share * f + self._mass * a for f, a in zip(held, acceleration, strict=True)]

    def root(self, root: Pose, q: Sequence[float]) -> Pose:
        """Return the pose of the root link in the world; root: its pose without displacement, q: displacements [m]."""
        x, y, z = root.position
        return Pose((x + q[0], y + q[1], z), root.orientation)


def _walking(body: Body, heading: float) -> str:
    robot = ElementTree.fromstring(body.urdf)
    mass = SHARE * body.total_mass
    inertia = 0.4 * mass * 0.1**2 * np.eye(3)  # any value will do, since the links do not rotate: a ball of 10 cm
    base = next(link for link in robot.findall("link") if link.get("name") == ROOT)
    write_inertial(base, mass, np.eye(4), inertia)
    SubElement(robot, "link", name=GROUND)
    write_inertial(SubElement(robot, "link", name=JOINTS[0]), mass, np.eye(4), inertia)
    cos, sin = math.cos(heading), math.sin(heading)
    ends = (GROUND, JOINTS[0], ROOT)
    # The joint axes are those of the world, written in axes of the root link, whose x points along the heading.
    for name, (parent, child), (x, y) in zip(JOINTS, pairwise(ends), ((cos, -sin), (sin, cos)), strict=True):
        joint = SubElement(robot, "joint", name=name, type="prismatic")
        SubElement(joint, "parent", link=parent)
        SubElement(joint, "child", link=child)
        SubElement(joint, "axis", xyz=f"{x!r} {y!r} 0")
        SubElement(joint, "limit", lower=repr(-REACH), upper=repr(REACH), effort="1e4", velocity="20")
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode")
