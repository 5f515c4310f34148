"""Calibration of a person's segment lengths and marker positions from one still pose.

Priors: joint angles are near the stated pose, lengths near de Leva's table, and markers near their positions in the
Plug-in Gait set. Root, joint angles and lengths are the weighted least-squares solution for the measured markers; each
marker is then fixed to its segment where it was measured.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import yaml

from hric_core.errors import CommandError
from hric_core.geometry import FloatArray, Vector, transformed
from hric_core.geometry.poses import inverse
from hric_core.parameters import Settings, mapping, number, numbers, read_yaml, section, unknown
from hric_human.body import Body, Subject, describe
from hric_human.body.segments import Builder
from hric_human.control.inverse_kinematics import Solver
from hric_human.control.marker_model import ROOT_MOTIONS, MarkerModel
from hric_human.control.whole_body import WholeBody
from hric_motion.tracking.tracker import PersonTracker, moved

DURATION = 1.0
"""Duration of the still pose [s]. The constants of this file are project defaults, unconfirmed."""
MAX_SWAY = 0.01
"""Maximum distance of a marker from its mean position in a still pose [m]."""
MIN_SHARE = 0.9
"""Minimum share of the frames in which a marker must be visible [1]."""
POSE_SPREAD, MARKER_SPREAD, LENGTH_SPREAD = 0.09, 0.01, 0.05
"""Prior standard deviations: of joints from the stated pose [rad], markers from the set [m], relative lengths [1]."""
MAX_LENGTH_CHANGE = 0.2
"""Maximum change of the logarithm of a length [1]."""
MAX_OFFSET = 0.06
"""Distance of a marker from its position in the set [m] above which a wrong label is assumed."""
STEP = 1e-3
"""Relative change of a length for numerical derivatives [1]."""
SETTLED = 1e-4
"""Step size at which the solver stops: root [m], [rad], joints [rad], logarithms of lengths [1]."""


@dataclass(frozen=True)
class BodyCalibration(Settings):
    """Result of a calibration: the body that was fitted to a person. It is stored as a YAML file."""

    separator = "."
    subject: Subject = section(Subject, text="with the fitted lengths")
    markers: Mapping[str, Vector] = mapping(numbers(3, unit="m"), text="position of each, in axes of its link")
    residual: float = number(
        minimum=0.0, unit="m", text="root mean square distance of the markers from their positions in the marker set"
    )

    def check(self, where: str) -> None:
        """Check that the body has the markers. Raises ParameterError."""
        known = describe(self.subject).markers
        for name in self.markers:
            if name not in known:
                raise unknown("marker", name, known, f"{where}markers")

    @classmethod
    def load(cls, path: Path) -> "BodyCalibration":
        """Read a calibration from a file that `save` wrote. Raises ParameterError."""
        return cls.of(read_yaml(path), f"{path.name}:")

    def save(self, path: Path) -> None:
        """Write the calibration as YAML. Raises CommandError if that fails."""
        values = asdict(self)
        values["markers"] = {name: [round(value, 6) for value in p] for name, p in self.markers.items()}
        values["subject"]["lengths"] = {name: round(length, 5) for name, length in self.subject.lengths.items()}
        values["residual"] = round(self.residual, 6)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(yaml.safe_dump(values, sort_keys=False))
        except OSError as error:
            raise CommandError(f"the calibration of the person cannot be written: {error}") from error

    @property
    def body(self) -> Body:
        """Fitted body with its calibrated marker positions."""
        body = describe(self.subject)
        markers = {
            name: replace(marker, p_link_marker=np.array(self.markers.get(name, marker.p_link_marker)))
            for name, marker in body.markers.items()
        }
        return replace(body, markers=markers)


class StillPose:
    """Collector of the motion capture frames of a still pose.

    Args:
        names: names of the markers.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._frames: list[FloatArray] = []
        self._began: float | None = None

    def add(self, time: float, positions: FloatArray) -> bool:
        """Add a frame at a time [s]; return True if the frames span DURATION.

        positions: positions of the markers, shape (m, 3) [m]; NaN: not visible.
        """
        if self._began is None or time < self._began:
            self._began, self._frames = time, []
        self._frames.append(positions)
        return time - self._began >= DURATION

    def mean(self) -> FloatArray:
        """Return the mean position of each marker, shape (m, 3) [m].

        Raises:
            CommandError: the person moved, or markers are missing; the text names the markers.
        """
        frames = np.array(self._frames)
        shares = np.isfinite(frames).all(axis=2).mean(axis=0)
        missing = [
            f"{name} ({share:.0%})" for name, share in zip(self._names, shares, strict=True) if share < MIN_SHARE
        ]
        if missing:
            raise CommandError(
                f"markers are missing in too many frames: visible are {', '.join(missing)}; valid: visible in at least "
                f"{MIN_SHARE:.0%} of the frames each"
            )
        mean: FloatArray = np.nanmean(frames, axis=0)
        sway = np.nanmax(np.linalg.norm(frames - mean, axis=2), axis=0)
        swayed = zip(self._names, sway, strict=True)
        if moving := [f"{name} {1e3 * far:.0f} mm" for name, far in swayed if far > MAX_SWAY]:
            raise CommandError(
                f"the person has moved: {', '.join(moving)} from the mean position; valid: up to "
                f"{1e3 * MAX_SWAY:.0f} mm in {DURATION:g} s"
            )
        return mean


def calibrate(
    subject: Subject, names: Sequence[str], positions: FloatArray, pose: Mapping[str, float]
) -> BodyCalibration:
    """Fit a body to a person in a still pose.

    Args:
        subject: subject with the person's height and mass; its measured lengths are start values of the fit.
        names: names of the markers.
        positions: mean positions of the markers, shape (m, 3) [m].
        pose: angles of joints that are not zero in the pose, by joint [rad].

    Raises:
        CommandError: a marker is far from its position in the set; the text names it.
        ParameterError: the body does not have a joint of `pose`.
    """
    fit = _Fit(subject, names, positions, pose)
    fitted = fit.fit()
    body = describe(fitted)
    poses = WholeBody(body).poses(fit.q.tolist(), fit.root)
    p_link, offsets = dict[str, Vector](), dict[str, float]()
    for name, position in zip(names, positions.tolist(), strict=True):
        marker = body.markers[name]
        p_link[name] = transformed(inverse(poses[marker.link]), position)
        offsets[name] = float(np.linalg.norm(np.array(p_link[name]) - marker.p_link_marker))
    refuse_far(offsets, MAX_OFFSET)
    residual = float(np.sqrt(np.mean(np.square(list(offsets.values())))))
    return BodyCalibration(subject=fitted, markers=p_link, residual=residual)


class _Fit:
    """Least-squares fit of root pose, joint angles and logarithms of lengths; arguments as of `calibrate`."""

    def __init__(
        self, subject: Subject, names: Sequence[str], positions: FloatArray, pose: Mapping[str, float]
    ) -> None:
        self._subject, self._names, self._positions = subject, tuple(names), positions
        body = describe(subject)
        for joint in pose:
            if joint not in body.joints:
                raise unknown("joint", joint, body.joints, "pose")
        self._pose = np.array([pose.get(joint, 0.0) for joint in body.joints])
        low, high = np.array([joint.range for joint in body.joints.values()]).T
        self._low, self._high = np.minimum(low, self._pose), np.maximum(high, self._pose)
        self._first = Builder(subject).lengths
        self.root = PersonTracker(body, names).root_from_trunk(positions, np.ones(len(names), bool), self._pose)
        self.q, self._changes = self._pose, np.zeros(len(self._first))

    def fit(self) -> Subject:
        """Return the subject with the best-fitting lengths; set `q` and `root` to the fitted posture.

        Raises:
            CommandError: markers are far from the body.
        """
        self._step(np.zeros((len(self._names), 3, 0)))
        self._check()
        for _ in range(2):  # the second time with derivatives by the lengths in the posture of the first
            p = self._at(self._changes)
            steps = STEP * np.eye(len(self._changes))
            self._step(np.stack([(self._at(self._changes + step) - p) / STEP for step in steps], axis=2))
        return self._with(self._changes)

    def _check(self) -> None:
        distances = np.linalg.norm(self._positions - self._at(self._changes), axis=1)
        refuse_far(dict(zip(self._names, distances.tolist(), strict=True)), 2.0 * MAX_OFFSET)

    def _step(self, by_length: FloatArray) -> None:
        """Solve for root, joints and lengths once.

        Args:
            by_length: derivatives of the markers by l log lengths, shape (m, 3, l) [m]; l = 0: the lengths are kept.
        """
        n, count = ROOT_MOTIONS + len(self.q), by_length.shape[2]
        first, root = self._changes, self.root
        spread = np.concatenate([np.full(n - ROOT_MOTIONS, POSE_SPREAD), np.full(count, LENGTH_SPREAD)])
        prior = np.hstack([np.zeros((len(spread), ROOT_MOTIONS)), np.diag(1.0 / spread)])
        marked = self._marked(first)

        def task(x: list[float]) -> tuple[FloatArray, FloatArray]:
            p, J = marked.at(x[ROOT_MOTIONS:n], moved(root, x[:ROOT_MOTIONS]))
            p = p + by_length @ (np.array(x[n:]) - first[:count])
            off = np.concatenate([self._pose, np.zeros(count)]) - x[ROOT_MOTIONS:]
            error = np.concatenate([(self._positions - p).ravel() / MARKER_SPREAD, off / spread])
            return error, np.vstack([np.concatenate([J, by_length], axis=2).reshape(-1, len(x)) / MARKER_SPREAD, prior])

        free, change = np.full(ROOT_MOTIONS, np.inf), np.full(count, MAX_LENGTH_CHANGE)
        solver = Solver(np.r_[-free, self._low, -change], np.r_[free, self._high, change], np.zeros(n + count))
        x, _ = solver.solve(task, np.r_[np.zeros(ROOT_MOTIONS), self.q, first[:count]], 0.0, SETTLED)
        self.root, self.q = moved(root, x[:ROOT_MOTIONS]), x[ROOT_MOTIONS:n]
        if count:
            self._changes = x[n:]

    def _at(self, changes: FloatArray) -> FloatArray:
        """Return the model's marker positions in the current posture, shape (m, 3) [m]; changes: of log lengths."""
        return self._marked(changes).at(self.q.tolist(), self.root)[0]

    def _marked(self, changes: FloatArray) -> MarkerModel:
        return MarkerModel(describe(self._with(changes)), self._names)

    def _with(self, changes: FloatArray) -> Subject:
        """Return the subject with its lengths multiplied by exp(change)."""
        if not changes.any():
            return self._subject
        lengths = dict(zip(self._first, (np.array(list(self._first.values())) * np.exp(changes)).tolist(), strict=True))
        return replace(self._subject, lengths=lengths)


def refuse_far(offsets: Mapping[str, float], limit: float) -> None:
    """Raise CommandError if markers are farther from their expected positions than `limit` [m].

    offsets: distance of each marker from its expected position [m].
    """
    if far := [f"{name} {1e3 * offset:.0f} mm" for name, offset in offsets.items() if offset > limit]:
        raise CommandError(
            f"markers are not where they belong: {', '.join(far)} off; valid: up to {1e3 * MAX_OFFSET:.0f} mm. Check "
            "that the person takes the stated pose and that the markers are labelled correctly"
        )
