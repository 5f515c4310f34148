"""Capsules of an observed person: of a body from its joint angles, or a sphere around a tracked hand."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hric_assessment.separation.capsules import of_body
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose
from hric_core.urdf import read
from hric_dynamics.tree import pose_row
from hric_human.body import Body
from hric_supervisor.placed import CapsuleTree

HAND = "hand, fingers"
"""Region of ISO/TS 15066 of a tracked hand."""


class Observation(NamedTuple):
    """Observation of a person at an instant, as capsules.

    Attributes:
        stamp: robot time of the measurement [s].
        frame: frame in which the capsules are given.
        ends: axis ends of the person's m capsules, shape (m, 2, 3) [m].
        radii: radii of the capsules, shape (m,) [m].
        links: name of each capsule's link.
        regions: regions of ISO/TS 15066 that each capsule may belong to; empty if it has none.
        dominant: True for capsules on the side of the dominant hand; None: not known.
        fault: reason why the data is invalid; empty: no fault.
        earlier: further observations since the last decision, oldest first.
    """

    stamp: float
    frame: str
    ends: FloatArray
    radii: FloatArray
    links: tuple[str, ...]
    regions: tuple[tuple[str, ...], ...]
    dominant: tuple[bool | None, ...]
    fault: str = ""
    earlier: "tuple[Observation, ...]" = ()


def unplaced(stamp: float, frame: str, fault: str) -> Observation:
    """Return an observation without capsules, with only a fault; stamp: robot time [s]."""
    return Observation(stamp, frame, np.zeros((0, 2, 3)), np.zeros(0), (), (), (), fault)


def joined(observations: Sequence[Observation], names: Sequence[str]) -> Observation:
    """Join the observations of all persons into one, with the oldest stamp.

    Links of several persons get the person's name as prefix.
    """
    if len(observations) == 1:
        return observations[0]
    pairs = list(zip(names, observations, strict=True))
    return Observation(
        min(seen.stamp for seen in observations),
        observations[0].frame,
        np.concatenate([seen.ends for seen in observations]),
        np.concatenate([seen.radii for seen in observations]),
        tuple(f"{name}/{link}" for name, seen in pairs for link in seen.links),
        tuple(regions for seen in observations for regions in seen.regions),
        tuple(dominant for seen in observations for dominant in seen.dominant),
    )


class BodyShape:
    """Capsules of a person's body as a function of joint angles.

    Args:
        body: body of the person.
        root: pose of the root link in the world, for a person who does not walk.
    """

    def __init__(self, body: Body, root: Pose) -> None:
        self._T_root, self._names, capsules = pose_row(root.transform()), tuple(body.joints), of_body(body)
        self._placed = CapsuleTree(read(body.urdf), self._names, capsules)
        self._radii, self.links = capsules.radii, capsules.links
        known = [body.regions.get(link, ()) for link in self.links]
        self._regions = tuple(tuple(region.name for region in regions) for regions in known)
        self._dominant = tuple(any(region.dominant for region in regions) if regions else None for regions in known)

    def seen(self, stamp: float, frame: str, angles: Mapping[str, float], root: Pose | None = None) -> Observation:
        """Return the observation of the person for joint angles.

        Args:
            stamp: robot time [s].
            frame: frame in which `root` is given.
            angles: joint angles by name [rad].
            root: pose of the root link in `frame`; None: that of the constructor.

        Raises:
            HricError: the angle of a joint is missing.
        """
        missing = [name for name in self._names if name not in angles]
        if missing:
            raise HricError(
                f"the angle of {', '.join(missing)} is missing; valid: all joints of the body, {', '.join(self._names)}"
            )
        return self.placed(stamp, frame, [angles[name] for name in self._names], root)

    def placed(self, stamp: float, frame: str, q: Sequence[float], root: Pose | None = None) -> Observation:
        """Return the observation of the person for all joint angles q, in the order of the body [rad]; see `seen`."""
        ends = self._placed(q, self._T_root if root is None else pose_row(root.transform()))
        return Observation(stamp, frame, ends, self._radii, self.links, self._regions, self._dominant)


def hand_ball(stamp: float, frame: str, position: Sequence[float], radius: float) -> Observation:
    """Return the observation of a tracked hand as a sphere.

    Args:
        stamp: robot time [s].
        frame: frame in which the position is given.
        position: position of the hand's rigid body, 3 floats [m].
        radius: radius of the sphere that contains the hand [m].
    """
    ends = np.tile(np.asarray(position, dtype=float), (1, 2, 1))
    return Observation(stamp, frame, ends, np.array([radius]), ("hand",), ((HAND,),), (None,))


def moved(seen: Observation, frame: str, T: FloatArray) -> Observation:
    """Transform an observation of a person to another frame.

    Args:
        seen: observation of the person.
        frame: name of the other frame.
        T: pose of the observation's frame in the other frame, shape (4, 4).
    """
    return seen._replace(frame=frame, ends=seen.ends @ T[:3, :3].T + T[:3, 3])
