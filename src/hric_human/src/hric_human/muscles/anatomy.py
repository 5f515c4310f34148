"""The muscles of an arm as numbers: what fits of a model leave behind, and the file that has it.

    anatomy = load(BUILT_IN)
    anatomy.muscles["bic_l"].max_force, anatomy.errors["bic_l"].arm_rms

A file is JSON with the attributes of `Anatomy`, a line for each muscle.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hric_control.errors import HricError
from hric_control.geometry import Vector
from hric_human.body.joints import ROWS
from hric_human.muscles.polynomial import Polynomial, exponents

BUILT_IN = Path(__file__).parents[3] / "config" / "muscles" / "delft.json"
"""Shoulder, elbow and forearm of the Delft model; its notice and its licence are beside it."""
CENTRES = ("shoulder", "elbow")
"""Joint centres across which muscles pull."""
SEGMENTS = ("torso", "upper_arm", "forearm")
"""Segments that a muscle's course goes along; the first two have their origin in the shoulder, the third in the
elbow."""
Course = tuple[tuple[str, Vector], ...]
"""Points of a line: segment, and place in axes of its link [m]."""


@dataclass(frozen=True)
class Muscle:
    """A line of action, rigid tendon.

    Attributes:
        name: without a side.
        max_force: isometric, along the line [N].
        optimal_length: of the fibres along the line [m].
        slack_length: of the tendon, which does not stretch [m].
        length: of fibres and tendon [m]; its negative gradient are the moment arms.
        pulls: by joint centre that it crosses: force on what lies distal, per force of the muscle [1], x, y and z in
            axes of the proximal link (torso, upper arm).
        course: where the line goes in the resting posture, to draw it; nothing is computed from it.
    """

    name: str
    max_force: float
    optimal_length: float
    slack_length: float
    length: Polynomial
    pulls: Mapping[str, tuple[Polynomial, Polynomial, Polynomial]]
    course: Course


@dataclass(frozen=True)
class FitError:
    """How far a muscle's polynomials are from its model at poses that the fit did not see.

    Attributes:
        length_rms: [m].
        arm_rms, arm_worst: of the moment arms about all its joints [m].
        pull_worst: largest difference of a pull, by joint centre [1].
    """

    length_rms: float
    arm_rms: float
    arm_worst: float
    pull_worst: Mapping[str, float]


@dataclass(frozen=True)
class Anatomy:
    """The muscles of a right arm; a left one is its mirror image.

    Attributes:
        name: of the model.
        joints: whose angles the polynomials take, names without a side.
        lower, upper: range of the fit, by joint [rad].
        muscles: by name.
        reference: lengths of the segments of the model, as those of a subject are named [m].
        notice: licence and credits.
        errors: of the fit, by muscle.
    """

    name: str
    joints: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    muscles: Mapping[str, Muscle]
    reference: Mapping[str, float]
    notice: str
    errors: Mapping[str, FitError]

    def save(self, path: Path) -> None:
        """Write the file. Raises OSError."""
        path.write_text(self.text())

    def text(self) -> str:
        """What a file of it has."""
        head = {key: getattr(self, key) for key in ("name", "notice", "joints", "lower", "upper", "reference")}
        lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
        errors = {name: asdict(error) for name, error in self.errors.items()}
        muscles = [f"  {json.dumps(_row(muscle))}" for muscle in self.muscles.values()]
        lines += [f' "errors": {json.dumps(errors)},', ' "muscles": [', ",\n".join(muscles), " ]"]
        return "\n".join(["{", *lines, "}", ""])


def load(path: Path) -> Anatomy:
    """Read a file.

    Raises:
        HricError: there is none, or it is not one of these.
    """
    try:
        content = json.loads(path.read_text())
        muscles = {row["name"]: _muscle(row) for row in content["muscles"]}
        return Anatomy(
            content["name"],
            tuple(content["joints"]),
            tuple(content["lower"]),
            tuple(content["upper"]),
            muscles,
            content["reference"],
            content["notice"],
            {name: FitError(**error) for name, error in content["errors"].items()},
        )
    except OSError as error:
        raise HricError(f"no muscles in {path}: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise HricError(f"{path} is not a file of `rosrun hric_human fit_muscles`: {error!r}") from error


def _row(muscle: Muscle) -> dict[str, Any]:
    row = asdict(muscle)
    row["length"] = _polynomial_row(muscle.length)
    row["pulls"] = {centre: [_polynomial_row(part) for part in pull] for centre, pull in muscle.pulls.items()}
    return row


def _polynomial_row(polynomial: Polynomial) -> list[Any]:
    return [polynomial.joints, polynomial.order, polynomial.coefficients]


def _muscle(row: Mapping[str, Any]) -> Muscle:
    force, optimal, slack = (float(row[key]) for key in ("max_force", "optimal_length", "slack_length"))
    if not (0.0 < force < math.inf and 0.0 < optimal < math.inf and 0.0 <= slack < math.inf):
        raise ValueError(f"muscle {row['name']}: {force} N, {optimal} m, {slack} m")
    pulls = {}
    for centre, (x, y, z) in row["pulls"].items():
        pulls[centre] = _polynomial(x), _polynomial(y), _polynomial(z)
    course = tuple((str(segment), (float(x), float(y), float(z))) for segment, (x, y, z) in row["course"])
    if len(course) < 2 or not {segment for segment, _ in course} <= set(SEGMENTS):
        raise ValueError(f"the course of {row['name']} is {course}")
    return Muscle(row["name"], force, optimal, slack, _polynomial(row["length"]), pulls, course)


def _polynomial(row: Any) -> Polynomial:
    joints, order, coefficients = row
    made = Polynomial(tuple(joints), int(order), tuple(map(float, coefficients)))
    if len(made.coefficients) != len(exponents(len(made.joints), made.order)) or not set(made.joints) <= set(ROWS):
        raise ValueError(f"{len(made.coefficients)} coefficients of order {order} about {joints}")
    return made
