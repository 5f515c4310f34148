"""Anatomy: the muscles of an arm as parameters and polynomials, fitted from a musculoskeletal model; and its file.

    anatomy = load(BUILT_IN)
    anatomy.muscles["bic_l"].max_force, anatomy.errors["bic_l"].arm_rms

The file is JSON with the attributes of `Anatomy`, and one line for each muscle.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from hric_core.errors import HricError
from hric_core.geometry import Vector
from hric_human.body.joints import ROWS
from hric_human.muscles.curves import SampledCurves
from hric_human.muscles.polynomial import Polynomial, exponents

BUILT_IN = Path(__file__).parents[3] / "config" / "muscles" / "delft.json"
"""File with the muscles of shoulder, elbow and forearm of the Delft model; its licence is in the same folder."""
CENTRES = ("shoulder", "elbow")
"""Names of the joint centres that muscles cross."""
SEGMENTS = ("torso", "upper_arm", "forearm")
"""Segments that points of a drawn muscle belong to; origin: the shoulder for the first two, the elbow for the third."""
MusclePath = tuple[tuple[str, Vector], ...]
"""Points of a muscle's drawn line, each with its segment and its position in axes of the segment's link [m]."""


@dataclass(frozen=True)
class Muscle:
    """Muscle (one line of action) with a rigid tendon.

    Attributes:
        name: name without a side.
        max_force: maximum isometric force along the line of action [N].
        optimal_length: optimal length of the fibres along the line of action [m].
        slack_length: length of the tendon, which does not stretch [m].
        length: length of fibres and tendon [m]; the moment arms are its negative gradient.
        pulls: force on the distal bone per muscle force [1], for each joint centre that the muscle crosses; x, y, z in
            axes of the proximal link (torso or upper arm).
        path: points of the muscle in the resting posture, only for drawing.
        curves: the muscle's own force-length-velocity curves; None: those of `hric_human.muscles.curves`.
    """

    name: str
    max_force: float
    optimal_length: float
    slack_length: float
    length: Polynomial
    pulls: Mapping[str, tuple[Polynomial, Polynomial, Polynomial]]
    path: MusclePath
    curves: SampledCurves | None = None


@dataclass(frozen=True)
class FitError:
    """Errors of a muscle's polynomials at poses that were not used in the fit.

    Attributes:
        length_rms: root mean square error of the length [m].
        arm_rms, arm_worst: root mean square and largest error of the moment arms about all joints of the muscle [m].
        pull_worst: largest error of the muscle's pull (`Muscle.pulls`), by joint centre [1].
    """

    length_rms: float
    arm_rms: float
    arm_worst: float
    pull_worst: Mapping[str, float]


@dataclass(frozen=True)
class Certificate:
    """Difference of static optimisation with fitted muscles from OpenSim's tool with the model, on one motion.

    Attributes:
        rms, largest: root mean square and largest difference of activations [1].
        highest: highest activation of OpenSim's solution [1].
        worst: root mean square difference of the muscles that differ most, by name [1].
    """

    rms: float
    largest: float
    highest: float
    worst: Mapping[str, float]

    def __str__(self) -> str:
        """Return the comparison as one line of text."""
        worst = ", ".join(f"{name} {value:.3f}" for name, value in self.worst.items())
        return (
            f"static optimisation against OpenSim's tool on a motion of 1 s: activations differ by {self.rms:.4f} RMS, "
            f"{self.largest:.3f} at most (highest activation: {self.highest:.2f}); most: {worst}"
        )


@dataclass(frozen=True)
class Anatomy:
    """Fitted muscles of a right arm; a left arm is its mirror image.

    Attributes:
        name: name of the model.
        joints: joints whose angles are the variables of the polynomials, names without a side.
        lower, upper: range of the fit, by joint [rad].
        muscles: muscles by name.
        reference: lengths of the model's segments [m], named like the keys of `Subject.lengths`.
        notice: licence and credits of the model.
        errors: errors of the fit, by muscle.
        certificate: comparison with OpenSim's static optimisation; None if there is none.
    """

    name: str
    joints: tuple[str, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    muscles: Mapping[str, Muscle]
    reference: Mapping[str, float]
    notice: str
    errors: Mapping[str, FitError]
    certificate: Certificate | None = None

    def save(self, path: Path) -> None:
        """Write the anatomy to a JSON file. Raises OSError."""
        path.write_text(self.text())

    def text(self) -> str:
        """Return the anatomy as JSON text."""
        head = {key: getattr(self, key) for key in ("name", "notice", "joints", "lower", "upper", "reference")}
        lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
        if self.certificate is not None:
            lines.append(f' "certificate": {json.dumps(asdict(self.certificate))},')
        errors = {name: asdict(error) for name, error in self.errors.items()}
        muscles = [f"  {json.dumps(_row(muscle))}" for muscle in self.muscles.values()]
        lines += [f' "errors": {json.dumps(errors)},', ' "muscles": [', ",\n".join(muscles), " ]"]
        return "\n".join(["{", *lines, "}", ""])


def load(path: Path) -> Anatomy:
    """Read an anatomy from its JSON file.

    Raises:
        HricError: the file does not exist, or is no valid anatomy.
    """
    try:
        content = json.loads(path.read_text())
        muscles = {row["name"]: _muscle(row) for row in content["muscles"]}
        if len({muscle.curves is None for muscle in muscles.values()}) > 1:
            raise ValueError("some muscles have curves and others have none; valid: all or none")
        certificate = content.get("certificate")
        return Anatomy(
            content["name"],
            tuple(content["joints"]),
            tuple(content["lower"]),
            tuple(content["upper"]),
            muscles,
            content["reference"],
            content["notice"],
            {name: FitError(**error) for name, error in content["errors"].items()},
            None if certificate is None else Certificate(**certificate),
        )
    except OSError as error:
        raise HricError(f"the muscle file {path} cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise HricError(f"{path} is not a file of `hric fit_muscles`: {error!r}") from error


class _MuscleRow(TypedDict):
    """Muscle as read from the JSON file, not yet checked."""

    name: str
    max_force: float
    optimal_length: float
    slack_length: float
    length: object
    pulls: Mapping[str, Sequence[object]]
    course: Sequence[tuple[str, Vector]]
    curves: NotRequired[Mapping[str, Any]]


def _row(muscle: Muscle) -> dict[str, object]:
    row = asdict(muscle)
    row["length"] = _polynomial_row(muscle.length)
    row["pulls"] = {centre: [_polynomial_row(part) for part in pull] for centre, pull in muscle.pulls.items()}
    row["course"] = row.pop("path")
    if muscle.curves is None:
        del row["curves"]
    return row


def _polynomial_row(polynomial: Polynomial) -> list[Any]:
    return [polynomial.joints, polynomial.order, polynomial.coefficients]


def _muscle(row: _MuscleRow) -> Muscle:
    force, optimal, slack = (float(row[key]) for key in ("max_force", "optimal_length", "slack_length"))
    if not (0.0 < force < math.inf and 0.0 < optimal < math.inf and 0.0 <= slack < math.inf):
        raise ValueError(
            f"muscle {row['name']}: max_force {force} N, optimal_length {optimal} m, slack_length {slack} m; valid: "
            "finite numbers, the first two above 0, slack_length at least 0"
        )
    pulls = {}
    for centre, (x, y, z) in row["pulls"].items():
        pulls[centre] = _polynomial(x), _polynomial(y), _polynomial(z)
    path = tuple((str(segment), (float(x), float(y), float(z))) for segment, (x, y, z) in row["course"])
    if len(path) < 2 or not {segment for segment, _ in path} <= set(SEGMENTS):
        raise ValueError(f"the course of muscle {row['name']} is {path}; valid: 2 points or more on {SEGMENTS}")
    return Muscle(row["name"], force, optimal, slack, _polynomial(row["length"]), pulls, path, _curves(row))


def _curves(row: _MuscleRow) -> SampledCurves | None:
    if "curves" not in row:
        return None
    numbers = dict(row["curves"])
    return SampledCurves(numbers.pop("max_velocity"), **{key: tuple(samples) for key, samples in numbers.items()})


def _polynomial(row: Any) -> Polynomial:
    joints, order, coefficients = row
    made = Polynomial(tuple(joints), int(order), tuple(map(float, coefficients)))
    if len(coefficients) != (size := len(exponents(len(joints), made.order))) or not set(joints) <= set(ROWS):
        raise ValueError(f"a polynomial of order {order} in {joints} has {len(coefficients)} coefficients, not {size}")
    return made
