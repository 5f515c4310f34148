"""Interface of an arm model for the fit, independent of the engine that reads it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hric_core.geometry import FloatArray


class Coordinate(NamedTuple):
    """Independent angle of a model.

    Attributes:
        name: name in the model.
        body: body that it moves.
        lower, upper, default: range and default [rad].
    """

    name: str
    body: str
    lower: float
    upper: float
    default: float


class Strengths(NamedTuple):
    """Strengths of K muscles along their lines of action.

    Attributes:
        force: isometric forces, shape (K,) [N].
        optimal_length: optimal lengths of fibres, shape (K,) [m].
        slack_length: slack lengths of tendons, shape (K,) [m].
    """

    force: FloatArray
    optimal_length: FloatArray
    slack_length: FloatArray


class ArmModel(ABC):
    """Model of an arm in one state.

    Attributes:
        name: name of the model.
        credits: authors and terms from its file.
        muscles: names of its K muscles.
        parents: parent by body, in the order of the tree; "" is the ground.
        coordinates: independent angles; dependent ones follow them.
        up: direction against gravity, in the ground, shape (3,).
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
        """Return rotation of shape (3, 3) and origin [m] of a body in the ground."""

    @abstractmethod
    def centre(self, body: str) -> FloatArray:
        """Return the centre of the joint between a body and its parent, in the ground, shape (3,) [m]."""

    @abstractmethod
    def mass_centre(self, body: str) -> FloatArray:
        """Return the centre of mass of a body in the ground, shape (3,) [m]."""

    @abstractmethod
    def lengths(self) -> FloatArray:
        """Return the lengths of muscles with their tendons, shape (K,) [m]."""

    @abstractmethod
    def muscle_paths(self) -> list[list[tuple[str, FloatArray]]]:
        """Return the points of each muscle's line from end to end: body ("": ground), position in the ground [m]."""

    @abstractmethod
    def pulls(self, body: str) -> FloatArray:
        """Return the force on a body and all distal ones, per unit of muscle force, in the ground, shape (K, 3) [1]."""

    @abstractmethod
    def strengths(self) -> Strengths:
        """Return the strengths of the muscles."""
