"""Placement of a model's right arm at given angles of the body's arm joints, and its muscles in that pose."""

import numpy as np

from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import rotation_about
from hric_human.body.joints import ARM
from hric_human.muscles.anatomy import CENTRES, SEGMENTS, MusclePath
from hric_human.muscles.fitting.bones import chain
from hric_human.muscles.fitting.matching import SHOULDER, Hinge, Matching
from hric_human.muscles.fitting.model import ArmModel, Coordinate
from hric_human.muscles.fitting.muscle_paths import frames_of, muscle_path, resting
from hric_human.muscles.fitting.posture import AXES, STEP, ModelPosture, rotation_vector, small_rotation
from hric_human.muscles.fitting.sample import R_LINK_OPENSIM

ACCURACY = 1e-8
"""Error of the orientation of the humerus at which the search for it stops [rad]."""
_STEPS, _STARTS, _LONGEST, _DAMPING = 30, 4, 0.5, 1e-12
"""Search for an orientation: maximum steps, random starts, maximum step [rad], and damping [1]."""
_SINGULAR = 1e4
"""Condition number of the shoulder's Jacobian above which derivatives by shoulder angles are noise [1]."""


class Placing:
    """Arm of a model that is moved to given angles of the arm joints of `hric_human.body`.

    Attributes:
        joints: names of the arm joints that the model has, in their order.
        hinges: joints that correspond to one coordinate of the model, by name of the joint.
        coordinates: names of the model's coordinates that move the joints.

    Raises:
        HricError: the model has no arm, or its coordinates do not match the joints of an arm.
    """

    def __init__(self, model: ArmModel) -> None:
        self._posture, self._model = ModelPosture(model), model
        self._matching = Matching(self._posture)
        self.hinges: dict[str, Hinge] = self._matching.hinges
        self._shoulder = self._matching.shoulder
        matched = {*self.hinges, *(SHOULDER if self._shoulder else ())}
        self.joints = tuple(row.name for row in ARM if row.name in matched)
        self.coordinates = [of.coordinate.name for of in self.hinges.values()] + [of.name for of in self._shoulder]
        self._solved: list[tuple[FloatArray, FloatArray]] = []

    def put(self, q: FloatArray) -> bool:
        """Set the angles of `joints`, shape (m,) [rad]; return True if the model reaches them within its ranges."""
        for name, angle in zip(self.joints, q.tolist(), strict=True):
            if name in self.hinges:
                self._posture.put(self.hinges[name].at(angle))
        return not self._shoulder or self._orient(q[: len(SHOULDER)])

    def slopes(self, q: FloatArray) -> FloatArray | None:
        """Return the derivatives of muscle lengths by the angles of `joints` at the current pose, shape (K, m) [m/rad].

        Return None if the shoulder is in a singular pose of the model.
        """
        made = {name: hinge.sign * self._differences(hinge.coordinate)[0] for name, hinge in self.hinges.items()}
        if self._shoulder:
            by_coordinate, rates = map(np.array, zip(*map(self._differences, self._shoulder), strict=True))
            if np.linalg.cond(rates) > _SINGULAR:
                return None
            R_1 = rotation_about(AXES["sh_flex"], q[0])
            R_2 = R_1 @ rotation_about(AXES["sh_abd"], q[1])
            ours = np.array([AXES["sh_flex"], R_1 @ AXES["sh_abd"], R_2 @ AXES["sh_rot"]])
            made |= dict(zip(SHOULDER, np.linalg.solve(rates.T, ours.T).T @ by_coordinate, strict=True))
        return np.array([made[name] for name in self.joints]).T

    def pulls(self) -> dict[str, FloatArray]:
        """Return, by joint centre, the force on the distal link for unit forces of the K muscles, shape (K, 3) [1].

        The axes are those of the proximal link: x forward, y left, z up.
        """
        bones, R = self._posture.bones, (self._matching.R_ground_thorax(), self._matching.R_ground_humerus())
        return {
            centre: self._model.pulls(body) @ axes @ R_LINK_OPENSIM.T
            for centre, body, axes in zip(CENTRES, (bones.shoulder, bones.forearm), R, strict=True)
        }

    def reference(self) -> dict[str, float]:
        """Return the lengths of the model's upper arm and forearm [m]; without a hand, that of the upper arm only."""
        posture = self._posture
        ends = {"upper_arm": posture.elbow - posture.shoulder}
        if posture.bones.wrist:
            ends["forearm"] = posture.wrist - posture.elbow
        return {name: float(np.linalg.norm(vector)) for name, vector in ends.items()}

    def muscle_paths(self) -> list[MusclePath]:
        """Return the points of all muscles for drawing, in the resting posture or as near to it as the model allows."""
        q = resting(self.joints)
        for k, name in enumerate(self.joints):
            if name in self.hinges:
                q[k] = min(max(q[k], self.hinges[name].range[0]), self.hinges[name].range[1])
        self.put(q)
        posture, right = self._posture, self._matching.R_ground_humerus() @ AXES["el_flex"]
        R_thorax = self._matching.R_ground_thorax()
        frames = frames_of(R_thorax, right, posture.shoulder, posture.elbow, posture.wrist)
        return [muscle_path(points, self._segment, frames) for points in self._model.muscle_paths()]

    def _segment(self, body: str) -> str:
        """Return the entry of SEGMENTS with which a body is drawn: girdle with the torso, hand with the forearm."""
        torso, upper_arm, forearm = SEGMENTS
        bodies, bones = chain(self._model, "", body), self._posture.bones
        return forearm if bones.forearm in bodies else upper_arm if bones.shoulder in bodies else torso

    def _differences(self, coordinate: Coordinate) -> tuple[FloatArray, FloatArray]:
        """Return derivatives by a coordinate: of lengths, shape (K,) [m/rad], and of humerus rotation, shape (3,)."""
        at, lengths, R = self._posture.angles[coordinate.name], [], []
        for angle in (at + STEP, at - STEP):
            self._posture.put({coordinate.name: angle})
            lengths.append(self._model.lengths())
            R.append(self._matching.R_thorax_humerus())
        self._posture.put({coordinate.name: at})
        return (lengths[0] - lengths[1]) / (2.0 * STEP), small_rotation(R[0] @ R[1].T) / (2.0 * STEP)

    def _orient(self, angles: FloatArray) -> bool:
        """Rotate the humerus to angles of SHOULDER [rad]; return True if the model reaches them."""
        R_target = np.eye(3)
        for name, angle in zip(SHOULDER, angles, strict=True):
            R_target = R_target @ rotation_about(AXES[name], angle)
        for start in self._starts(angles):
            coordinates = self._search(R_target, start)
            if coordinates is not None:
                self._solved.append((angles, coordinates))
                return True
        return False

    def _starts(self, angles: FloatArray) -> FloatArray:
        """Return start values of the search: coordinates of the nearest solved pose, defaults, and random values."""
        lower, upper = self._ranges()
        drawn = lower + (upper - lower) * np.random.default_rng(0).random((_STARTS, len(lower)))
        near = [min(self._solved, key=lambda pose: float(np.linalg.norm(pose[0] - angles)))[1]] if self._solved else []
        return np.array([*near, [coordinate.default for coordinate in self._shoulder], *drawn])

    def _ranges(self) -> tuple[FloatArray, FloatArray]:
        """Return the lower and upper limits of the shoulder's coordinates, shape (3,) each [rad]."""
        lower = [coordinate.lower for coordinate in self._shoulder]
        return np.array(lower), np.array([coordinate.upper for coordinate in self._shoulder])

    def _search(self, R_target: FloatArray, start: FloatArray) -> FloatArray | None:
        """Find the shoulder's coordinates for an orientation by Newton's method; None if none are found in range."""
        c, names = start.copy(), [coordinate.name for coordinate in self._shoulder]
        for _ in range(_STEPS):
            self._posture.put(dict(zip(names, c.tolist(), strict=True)))
            missing = rotation_vector(R_target @ self._matching.R_thorax_humerus().T)
            if np.linalg.norm(missing) < ACCURACY:
                lower, upper = self._ranges()
                periods = np.round((c - 0.5 * (lower + upper)) / (2.0 * np.pi))
                c -= 2.0 * np.pi * periods
                self._posture.put(dict(zip(names, c.tolist(), strict=True)))
                return c if bool(np.all((lower - ACCURACY <= c) & (c <= upper + ACCURACY))) else None
            J = self._rates()
            step = np.linalg.solve(J.T @ J + _DAMPING * np.eye(len(c)), J.T @ missing)
            c += step * min(1.0, _LONGEST / max(_LONGEST, float(np.abs(step).max())))
        return None

    def _rates(self) -> FloatArray:
        """Return the Jacobian of the humerus' rotation in the thorax by the shoulder's coordinates, shape (3, 3)."""
        columns, R = [], self._matching.R_thorax_humerus()
        for coordinate in self._shoulder:
            at = self._posture.angles[coordinate.name]
            self._posture.put({coordinate.name: at + STEP})
            columns.append(small_rotation(self._matching.R_thorax_humerus() @ R.T) / STEP)
            self._posture.put({coordinate.name: at})
        return np.array(columns).T
