"""Interface of a musculoskeletal arm model for the fit of muscles, independent of the engine that reads it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hric_core.geometry import FloatArray
from hric_human.muscles.curves import SampledCurves


class Coordinate(NamedTuple):
    """Independent generalised coordinate of a model, an angle.

    Attributes:
        name: name in the model.
        body: body that the coordinate moves.
        lower, upper, default: range and default value [rad].
    """

    name: str
    body: str
    lower: float
    upper: float
    default: float


class Strengths(NamedTuple):
    """Force and length parameters of K muscles along their lines of action.

    Attributes:
        force: maximum isometric forces, shape (K,) [N].
        optimal_length: optimal fibre lengths, shape (K,) [m].
        slack_length: tendon slack lengths, shape (K,) [m].
    """

    force: FloatArray
    optimal_length: FloatArray
    slack_length: FloatArray


class ArmModel(ABC):
    """Model of an arm at one set of coordinates.

    Attributes:
        name: name of the model.
        credits: authors and licence, as stated in the model's file.
        muscles: names of the model's K muscles.
        parents: parent of each body, parents first; "" is the ground.
        coordinates: independent coordinates; dependent ones follow them.
        up: unit vector against gravity, in the ground frame, shape (3,).
    """

    name: str
    credits: str
    muscles: Sequence[str]
    parents: Mapping[str, str]
    coordinates: Sequence[Coordinate]
    up: FloatArray

    @abstractmethod
    def put(self, angles: Mapping[str, float]) -> None:
        """Set coordinates by name [rad]; the others do not change."""

    @abstractmethod
    def frame(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return rotation, shape (3, 3), and origin [m] of a body in the ground frame."""

    @abstractmethod
    def centre(self, body: str) -> FloatArray:
        """Return the centre of the joint between a body and its parent, in the ground frame, shape (3,) [m]."""

    @abstractmethod
    def mass_centre(self, body: str) -> FloatArray:
        """Return the centre of mass of a body in the ground frame, shape (3,) [m]."""

    @abstractmethod
    def lengths(self) -> FloatArray:
        """Return the lengths of the muscles including their tendons, shape (K,) [m]."""

    @abstractmethod
    def muscle_paths(self) -> list[list[tuple[str, FloatArray]]]:
        """Return the points of each muscle's path: body ("" is the ground), and position in the ground frame [m]."""

    @abstractmethod
    def pulls(self, body: str) -> FloatArray:
        """Return the sum of each muscle's forces on a body and all distal ones, per muscle force, shape (K, 3) [1].

        The forces are in axes of the ground.
        """

    def curves(self) -> Sequence[SampledCurves | str | None]:
        """Return for each muscle its own curves, the reason why they cannot be used, or None: the built-in curves."""
        return [None] * len(self.muscles)

    @abstractmethod
    def strengths(self) -> Strengths:
        """Return the force and length parameters of the muscles."""
