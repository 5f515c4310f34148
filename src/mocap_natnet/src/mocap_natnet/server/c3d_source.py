"""Motion of a body, and of each of its markers, from a c3d file. Needs no ROS."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray, Pose, Track, Vector, quaternion_from_rotation
from hric_core.trial import description
from hric_core.trial.c3d import Trial
from mocap_natnet.rigid_body import on_one_line, poses_of_points

ON_FRAME = 1e-6
"""Largest distance of a time from that of a frame with which both count as equal [frame periods]."""


class RecordedBody:
    """Rigid body made of markers of a recorded trial: source of its pose and its visible markers.

    The body's axes are those of the laboratory in the first frame that shows all of its markers; its origin is their
    centroid. With three markers or more its pose is fitted to the visible ones, three at least; with one or two its
    orientation is constant, and all must be visible. Before its first and after its last visible frame the pose is
    constant.

    Args:
        trial: recorded trial.
        labels: labels of the body's markers in the trial.

    Attributes:
        markers: positions of the markers in the body [m].
        duration: duration of the trial [s].

    Raises:
        HricError: a marker does not exist, no frame shows all of them, or three or more are all on one line.
    """

    def __init__(self, trial: Trial, labels: Sequence[str]) -> None:
        self._positions, self._rate = trial.markers(labels), trial.rate
        self.duration = trial.duration
        there = np.asarray(np.isfinite(self._positions).all(axis=2))
        complete = np.flatnonzero(there.all(axis=1))
        if not len(complete):
            raise ParameterError(
                f"no frame of {trial.name} shows all of {', '.join(labels)}; valid: markers that are seen together"
            )
        first = self._positions[complete[0]]
        in_body = first - first.mean(axis=0)
        if len(labels) > 2 and on_one_line(in_body):
            raise ParameterError(
                f"the markers {', '.join(labels)} of {trial.name} are on one line; valid: three that span a "
                "triangle, or one or two"
            )
        self.markers: tuple[Vector, ...] = tuple((x, y, z) for x, y, z in in_body.tolist())
        p, R, self._tracked = _fit(in_body, self._positions, there)
        frames = np.flatnonzero(self._tracked)
        poses = [
            Pose((x, y, z), quaternion_from_rotation(rotation))
            for (x, y, z), rotation in zip(p[frames].tolist(), R[frames], strict=True)
        ]
        self._track = Track((frames / self._rate).tolist(), poses)

    def pose(self, time: float) -> Pose:
        """Return the pose at a time of the trial [s]; gaps are interpolated linearly."""
        return self._track(time)

    def __call__(self, time: float) -> Pose | None:
        """Return the pose at a time of the trial [s]; None if it was not visible."""
        before, after, _ = self._frames(time)
        return self._track(time) if self._tracked[before] and self._tracked[after] else None

    def seen(self, time: float) -> tuple[Vector | None, ...]:
        """Return the position of each marker [m], linear between two frames; None: not visible in one of them."""
        before, after, share = self._frames(time)
        points = (
            (1 - share) * self._positions[before] + share * self._positions[after] if share else self._positions[before]
        )
        return tuple((x, y, z) if x == x else None for x, y, z in points.tolist())

    def _frames(self, time: float) -> tuple[int, int, float]:
        """Return the indices of the frames before and after a time [s], and the position between them, 0 to 1."""
        last = len(self._positions) - 1
        if time < 0.0:
            first = int(np.argmax(self._tracked))
            return first, first, 0.0
        position = min(max(time * self._rate, 0.0), float(last))
        near = round(position)
        if abs(position - near) < ON_FRAME:
            return near, near, 0.0
        before = math.floor(position)
        return before, before + 1, position - before


def labels_of(trial: Trial, name: str) -> list[str]:
    """Return the labels of a body's markers, which begin with its name as in exports of this workspace ("hand_1").

    Raises:
        HricError: there are no such labels; the message lists all labels.
    """
    labels = description.labels_of(trial.labels, name)
    if not labels and not trial.labels:
        raise ParameterError(f"{trial.name} has no markers")
    if not labels:
        raise ParameterError(
            f"no marker of {trial.name} begins with {name!r}; give labels; valid: {', '.join(trial.labels)}"
        )
    return labels


def _fit(
    in_body: FloatArray, seen: FloatArray, there: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return p (frames, 3), R (frames, 3, 3) and validity (frames,) of the body in frames with enough markers."""
    frames, count = there.shape
    p, R, tracked = np.zeros((frames, 3)), np.tile(np.eye(3), (frames, 1, 1)), np.zeros(frames, dtype=bool)
    patterns, which = np.unique(there, axis=0, return_inverse=True)
    for number, shown in enumerate(patterns):
        rows = np.flatnonzero(np.ravel(which) == number)
        body = in_body[shown]
        if count < 3 and shown.all():
            p[rows], tracked[rows] = seen[rows].mean(axis=1), True
        elif count >= 3 and len(body) >= 3 and not on_one_line(body):
            p[rows], R[rows] = poses_of_points(body, seen[np.ix_(rows, np.flatnonzero(shown))])
            tracked[rows] = True
    return p, R, tracked
