"""Muscles of an arm as numbers: the result of fitting a model, and its file.

    anatomy = load(BUILT_IN)
    anatomy.muscles["bic_l"].max_force, anatomy.errors["bic_l"].arm_rms

A file is JSON with the attributes of `Anatomy`, a line for each muscle.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypedDict

from hric_core.errors import HricError
from hric_core.geometry import Vector
from hric_human.body.joints import ROWS
from hric_human.muscles.polynomial import Polynomial, exponents

BUILT_IN = Path(__file__).parents[3] / "config" / "muscles" / "delft.json"
"""File of shoulder, elbow and forearm of the Delft model; its notice and licence are in the same folder."""
CENTRES = ("shoulder", "elbow")
"""Joint centres that muscles cross."""
SEGMENTS = ("torso", "upper_arm", "forearm")
"""Segments of a muscle's drawn line; the first two have their origin in the shoulder, the third in the elbow."""
MusclePath = tuple[tuple[str, Vector], ...]
"""Points of a line: segment, and position in axes of its link [m]."""


@dataclass(frozen=True)
class Muscle:
    """Line of action of a muscle, with rigid tendon.

    Attributes:
        name: without a side.
        max_force: maximum isometric force along the line [N].
        optimal_length: optimal length of the fibres along the line [m].
        slack_length: length of the tendon, which does not stretch [m].
        length: length of fibres and tendon [m]; its negative gradient is the moment arms.
        pulls: by joint centre that it crosses: force on the distal part per force of the muscle [1], x, y and z in axes
            of the proximal link (torso, upper arm).
        path: line in the resting posture, only for drawing.
    """

    name: str
    max_force: float
    optimal_length: float
    slack_length: float
    length: Polynomial
    pulls: Mapping[str, tuple[Polynomial, Polynomial, Polynomial]]
    path: MusclePath


@dataclass(frozen=True)
class FitError:
    """Errors of a muscle's polynomials at poses that were not used in the fit.

    Attributes:
        length_rms: root mean square error of the length [m].
        arm_rms, arm_worst: errors of the moment arms about all its joints [m].
        pull_worst: largest error of a pull, by joint centre [1].
    """

    length_rms: float
    arm_rms: float
    arm_worst: float
    pull_worst: Mapping[str, float]


@dataclass(frozen=True)
class Anatomy:
    """Muscles of a right arm; a left one is its mirror image.

    Attributes:
        name: name of the model.
        joints: joints whose angles the polynomials take, names without a side.
        lower, upper: range of the fit, by joint [rad].
        muscles: muscles by name.
        reference: lengths of the model's segments, with the names of a subject's lengths [m].
        notice: licence and credits.
        errors: errors of the fit, by muscle.
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
        """Return the text of its file."""
        head = {key: getattr(self, key) for key in ("name", "notice", "joints", "lower", "upper", "reference")}
        lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
        errors = {name: asdict(error) for name, error in self.errors.items()}
        muscles = [f"  {json.dumps(_row(muscle))}" for muscle in self.muscles.values()]
        lines += [f' "errors": {json.dumps(errors)},', ' "muscles": [', ",\n".join(muscles), " ]"]
        return "\n".join(["{", *lines, "}", ""])


def load(path: Path) -> Anatomy:
    """Read a file.

    Raises:
        HricError: the file does not exist, or is not a file of this kind.
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
        raise HricError(f"{path} is not a file of `hric fit_muscles`: {error!r}") from error


class _MuscleRow(TypedDict):
    """Muscle in the file; its parts are checked as they are read."""

    name: str
    max_force: float
    optimal_length: float
    slack_length: float
    length: object
    pulls: Mapping[str, Sequence[object]]
    course: Sequence[tuple[str, Vector]]


def _row(muscle: Muscle) -> dict[str, object]:
    row = asdict(muscle)
    row["length"] = _polynomial_row(muscle.length)
    row["pulls"] = {centre: [_polynomial_row(part) for part in pull] for centre, pull in muscle.pulls.items()}
    row["course"] = row.pop("path")
    return row


def _polynomial_row(polynomial: Polynomial) -> list[Any]:
    return [polynomial.joints, polynomial.order, polynomial.coefficients]


def _muscle(row: _MuscleRow) -> Muscle:
    force, optimal, slack = (float(row[key]) for key in ("max_force", "optimal_length", "slack_length"))
    if not (0.0 < force < math.inf and 0.0 < optimal < math.inf and 0.0 <= slack < math.inf):
        raise ValueError(f"muscle {row['name']}: {force} N, {optimal} m, {slack} m")
    pulls = {}
    for centre, (x, y, z) in row["pulls"].items():
        pulls[centre] = _polynomial(x), _polynomial(y), _polynomial(z)
    path = tuple((str(segment), (float(x), float(y), float(z))) for segment, (x, y, z) in row["course"])
    if len(path) < 2 or not {segment for segment, _ in path} <= set(SEGMENTS):
        raise ValueError(f"the course of {row['name']} is {path}")
    return Muscle(row["name"], force, optimal, slack, _polynomial(row["length"]), pulls, path)


def _polynomial(row: Any) -> Polynomial:
    joints, order, coefficients = row
    made = Polynomial(tuple(joints), int(order), tuple(map(float, coefficients)))
    if len(made.coefficients) != len(exponents(len(made.joints), made.order)) or not set(made.joints) <= set(ROWS):
        raise ValueError(f"{len(made.coefficients)} coefficients of order {order} about {joints}")
    return made
