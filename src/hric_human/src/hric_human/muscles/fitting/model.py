"""What the fit needs of a model of an arm, whatever engine reads it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hric_control.geometry import FloatArray


class Coordinate(NamedTuple):
    """An angle of a model that no constraint gives.

    Attributes:
        name: of the model.
        body: that it moves.
        lower, upper, default: [rad].
    """

    name: str
    body: str
    lower: float
    upper: float
    default: float


class Strengths(NamedTuple):
    """Of K muscles along their lines of action.

    Attributes:
        force: isometric, shape (K,) [N].
        optimal_length: of fibres, shape (K,) [m].
        slack_length: of tendons, shape (K,) [m].
    """

    force: FloatArray
    optimal_length: FloatArray
    slack_length: FloatArray


class ArmModel(ABC):
    """A model of an arm in one state.

    Attributes:
        name: of the model.
        credits: its authors and terms, as its file has them.
        muscles: names of K of them.
        parents: by body, in the order of the tree; "" is the ground.
        coordinates: angles that no constraint gives; those it gives follow them.
        up: against gravity, in the ground, shape (3,).
    """

    name: str
    credits: str
    muscles: Sequence[str]
    parents: Mapping[str, str]
    coordinates: Sequence[Coordinate]
    up: FloatArray

    @abstractmethod
    def put(self, angles: Mapping[str, float]) -> None:
        """Coordinates by name [rad]; others stay."""

    @abstractmethod
    def frame(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Rotation of shape (3, 3) and origin [m] of a body in the ground."""

    @abstractmethod
    def centre(self, body: str) -> FloatArray:
        """Of the joint between a body and its parent, in the ground, shape (3,) [m]."""

    @abstractmethod
    def mass_centre(self, body: str) -> FloatArray:
        """In the ground, shape (3,) [m]."""

    @abstractmethod
    def lengths(self) -> FloatArray:
        """Of muscles with their tendons, shape (K,) [m]."""

    @abstractmethod
    def courses(self) -> list[list[tuple[str, FloatArray]]]:
        """Points of each muscle's line from end to end: body, "" the ground, and place in the ground [m]."""

    @abstractmethod
    def pulls(self, body: str) -> FloatArray:
        """Force on a body and all behind it per force of each muscle, in the ground, shape (K, 3) [1]."""

    @abstractmethod
    def strengths(self) -> Strengths:
        """Of the muscles."""
