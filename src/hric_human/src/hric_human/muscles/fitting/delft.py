"""Built-in anatomy: 34 lines of action on shoulder, elbow and forearm, from das4_v4.osim.

Muscle lengths include the motion of the shoulder girdle, which follows the arm (shoulder rhythm). Moment arms at the
shoulder are about the glenohumeral joint with the girdle fixed, as measured on a specimen: a muscle between thorax and
arm also moves the girdle, whose muscles are not modelled here.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import rotation_about
from hric_human.muscles.anatomy import CENTRES, SEGMENTS, Anatomy, FitError, Muscle, MusclePath
from hric_human.muscles.fitting.fit import fit_error, fit_muscle, rounded
from hric_human.muscles.fitting.girdle import Girdle, angles_yzx, angles_yzy
from hric_human.muscles.fitting.groups import GROUPS, Group
from hric_human.muscles.fitting.muscle_paths import frames_of, muscle_path, resting
from hric_human.muscles.fitting.repair import repaired
from hric_human.muscles.fitting.sample import R_LINK_OPENSIM, MuscleSamples, Paths, poses
from hric_human.muscles.polynomial import Polynomial

RANGE = {
    "sh_flex": (-10.0, 110.0),
    "sh_abd": (-5.0, 75.0),
    "sh_rot": (-50.0, 70.0),
    "el_flex": (5.0, 130.0),
    "pro_sup": (-60.0, 60.0),
}
"""Range of the fit by joint [deg]. Beyond 65 deg of pronation the biceps path of das4_v4.osim jumps across a bone."""
JOINTS = tuple(RANGE)
LOWER = tuple(math.radians(low) for low, _ in RANGE.values())
UPPER = tuple(math.radians(high) for _, high in RANGE.values())
NOTICE = (
    "MIT License, Copyright (c) 2020 Aberdeen Biomechanics & Biomedical Engineering: LICENSE.delft. Fitted from "
    "das4_v4.osim of the Dynamic Arm Simulator (github.com/AbdnBiomechEng/arm-model), made by Dimitra Blana after the "
    "Delft shoulder and elbow model (Blana et al., J. Biomech. 41:1714, 2008) with measurements of Klein Breteler et "
    "al., J. Biomech. 32:1191, 1999. Cite Chadwick et al., IEEE Trans. Biomed. Eng. 61:1947, 2014."
)
"""Licence and credits of the model, stored with its anatomy."""
SAMPLES, UNSEEN = 1536, 384
"""Number of poses used for the fit, and of further poses used to test it."""
FIBRES = (0.45, 1.55)
"""Accepted range of an element's fibre length per optimal length [1].

If the fibres leave it, optimal length and tendon slack length are identified again.
"""
LINE_FIBRES, LINE_MIDDLE = (0.42, 1.36), 0.88
"""Accepted range of a fitted line's fibre length per optimal length [1], and the mean that is set if it leaves it.

In this range the passive torque stays below 10 N m; project default, unconfirmed.
"""
MEAN_FIBRE, FIBRE_SPAN = 0.95, 0.9
"""Mean and maximum span of an element's fibre length per optimal length [1], if its lengths are identified again.

Project default, unconfirmed.
"""
_X, _Y, _Z = np.eye(3)
STEP = 1e-4
"""Step of the numerical differences for moment arms [rad]."""
_COORDINATES = ("SC_y", "SC_z", "SC_x", "AC_y", "AC_z", "AC_x", "GH_y", "GH_z", "GH_yy", "EL_x", "PS_y")
_UPPER_ARM = ("humerus_1", "humerus_2", "humerus_r")
_FOREARM = ("ulna_r", "radius_r")
_ARM = (*_UPPER_ARM, *_FOREARM)


def _humerus(q: FloatArray) -> FloatArray:
    """Return the rotation of the humerus in the thorax, shape (3, 3), for sh_flex, sh_abd, sh_rot [rad]."""
    return rotation_about(_X, q[0]) @ rotation_about(_Z, q[1]) @ rotation_about(_Y, q[2])


class DelftArm:
    """Repaired Delft arm model whose shoulder girdle follows the arm.

    Attributes:
        paths: muscle paths of the model.
    """

    def __init__(self, path: Path) -> None:
        self.paths = Paths(repaired(path))
        self._girdle = Girdle()
        self._humerus, self._forearm = self.paths.numbers(_ARM), self.paths.numbers(_FOREARM)

    def put(self, q: FloatArray, girdle: FloatArray | None = None) -> None:
        """Set the angles of JOINTS, shape (5,) [rad]; girdle: angles that the girdle follows instead of q."""
        R_thorax_humerus = _humerus(q)
        leading = R_thorax_humerus if girdle is None else _humerus(girdle)
        R_thorax_clavicle, R_thorax_scapula = self._girdle.rotations(-leading[:, 1])
        angles = (
            *angles_yzx(R_thorax_clavicle),
            *angles_yzx(R_thorax_clavicle.T @ R_thorax_scapula),
            *angles_yzy(R_thorax_scapula.T @ R_thorax_humerus),
            q[3],
            q[4] + 0.5 * math.pi,
        )
        self.paths.put(dict(zip(_COORDINATES, angles, strict=True)))

    def sample(self, q: FloatArray) -> MuscleSamples:
        """Sample lengths, moment arms and forces across joints of the muscle elements at poses, shape (N, 5) [rad]."""
        at = [self._at(pose) for pose in q]
        length, arms, *pulls = (np.array(values) for values in zip(*at, strict=True))
        return MuscleSamples(q, length, arms, dict(zip(CENTRES, pulls, strict=True)))

    def _at(self, pose: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return lengths [m], moment arms [m], and forces across shoulder and elbow per muscle force at a pose [1]."""
        slopes = []
        for step in STEP * np.eye(len(JOINTS)):
            self.put(pose + step, girdle=pose)
            longer = self.paths.lengths()
            self.put(pose - step, girdle=pose)
            slopes.append((longer - self.paths.lengths()) / (2.0 * STEP))
        self.put(pose)
        lines, (R_ground_humerus, _) = self.paths.lines(), self.paths.frame("humerus_r")
        shoulder = lines.pull(self._humerus) @ R_LINK_OPENSIM.T
        elbow = lines.pull(self._forearm) @ R_ground_humerus @ R_LINK_OPENSIM.T
        return self.paths.lengths(), -np.array(slopes).T, shoulder, elbow

    def muscle_paths(self) -> list[MusclePath]:
        """Return the points through which the elements are drawn, in the resting posture."""
        q = resting(JOINTS)
        self.put(q)
        R_ground_thorax, _ = self.paths.frame("thorax")
        R_ground_humerus = R_ground_thorax @ _humerus(q)
        frames = frames_of(R_ground_thorax, R_ground_humerus @ _X, *self.paths.centres(("gh1", "hu", "radiocarpal")))
        return [muscle_path(points, _segment, frames) for points in self.paths.muscle_paths()]

    def reference(self) -> dict[str, float]:
        """Return the lengths of upper arm and forearm in the model [m]."""
        self.put(np.zeros(len(JOINTS)))
        shoulder, elbow, wrist = self.paths.centres(("gh1", "hu", "radiocarpal"))
        return {
            "upper_arm": rounded(float(np.linalg.norm(elbow - shoulder))),
            "forearm": rounded(float(np.linalg.norm(wrist - elbow))),
        }


def _segment(body: str) -> str:
    """Return the entry of SEGMENTS with which points of a body are drawn; the girdle belongs to the torso."""
    torso, upper_arm, forearm = SEGMENTS
    return upper_arm if body in _UPPER_ARM else forearm if body in _FOREARM else torso


def fit(path: Path) -> Anatomy:
    """Fit the muscles of the file das4_v4.osim.

    Raises:
        HricError: the file is not das4_v4.osim.
    """
    arm = DelftArm(path)
    elements = arm.sample(poses(LOWER, UPPER, SAMPLES + UNSEEN))
    forces, optimal, slack = _identified(arm.paths, elements.length[:SAMPLES])
    shares = forces * [[name in group.elements for name in arm.paths.names] for group in GROUPS]
    summed = shares.sum(axis=1)
    weights = shares / summed[:, None]
    lines = elements.joined(weights)
    seen, unseen = lines.part(slice(None, SAMPLES)), lines.part(slice(SAMPLES, None))
    muscles, errors, paths = dict[str, Muscle](), dict[str, FitError](), arm.muscle_paths()
    for k, group in enumerate(GROUPS):
        numbers = float(summed[k]), float(weights[k] @ optimal), float(weights[k] @ slack)
        drawn = paths[int(shares[k].argmax())]  # drawn through the points of the strongest element
        if group.arm:
            muscles[group.name], errors[group.name] = _constant(group, *numbers, drawn), FitError(0.0, 0.0, 0.0, {})
        else:
            muscles[group.name] = _usable(fit_muscle(seen, k, JOINTS, group.name, *numbers, drawn), seen)
            errors[group.name] = fit_error(unseen, k, JOINTS, muscles[group.name])
    return Anatomy("delft", JOINTS, LOWER, UPPER, muscles, arm.reference(), NOTICE, errors)


def _constant(group: Group, force: float, optimal: float, slack: float, drawn: MusclePath) -> Muscle:
    """Return a muscle that only pronates or supinates the forearm (joint pro_sup), with a constant moment arm."""
    length = Polynomial(("pro_sup",), 1, (rounded(slack + MEAN_FIBRE * optimal), -group.arm))
    return Muscle(group.name, rounded(force), rounded(optimal), rounded(slack), length, {}, drawn)


def _usable(muscle: Muscle, samples: MuscleSamples) -> Muscle:
    """Return the muscle, with fibre and tendon lengths identified again if its fibres leave LINE_FIBRES."""
    values = muscle.length.values(samples.q[:, [JOINTS.index(name) for name in muscle.length.joints]])
    ends = np.array([values.min(), values.max()])
    optimal, slack = _within(LINE_FIBRES, LINE_MIDDLE, ends, muscle.optimal_length, muscle.slack_length)
    return replace(muscle, optimal_length=rounded(optimal), slack_length=rounded(slack))


def _identified(paths: Paths, length: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return force along the line of action [N], optimal fibre length [m] and tendon slack length [m] of the elements.

    The file's values are kept if the muscle-tendon lengths `length`, shape (poses, elements) [m], keep the fibres
    within FIBRES; otherwise they are identified again. Since the repaired heads of the triceps share one insertion,
    their tendon slack length is set such that the fibres have the optimal length at the mean muscle-tendon length.
    """
    muscles = [paths.model.getMuscles().get(name) for name in paths.names]
    pennation = np.array([muscle.getPennationAngleAtOptimalFiberLength() for muscle in muscles])
    forces = np.array([muscle.getMaxIsometricForce() for muscle in muscles]) * np.cos(pennation)
    optimal = np.array([muscle.getOptimalFiberLength() for muscle in muscles])
    slack = np.array([muscle.getTendonSlackLength() for muscle in muscles])
    optimal, slack = np.transpose(
        [_within(FIBRES, MEAN_FIBRE, *of) for of in zip(length.T, optimal, slack, strict=True)]
    )
    triceps = np.array([name.startswith("tric_") for name in paths.names])
    return forces, optimal, np.where(triceps, length.mean(axis=0) - optimal, slack)


def _within(
    bounds: tuple[float, float], mean: float, length: FloatArray, optimal: float, slack: float
) -> tuple[float, float]:
    """Return optimal fibre length and tendon slack length [m] with which the fibres stay within bounds.

    The given values are returned if they do so at muscle-tendon lengths `length`, shape (poses,) [m]; `mean`: mean
    fibre length per optimal length otherwise [1].
    """
    shortest, longest = float(length.min()), float(length.max())
    if bounds[0] * optimal <= shortest - slack and longest - slack <= bounds[1] * optimal:
        return optimal, slack
    optimal = max(optimal, (longest - shortest) / FIBRE_SPAN)
    return optimal, max(0.0, float(length.mean()) - mean * optimal)
