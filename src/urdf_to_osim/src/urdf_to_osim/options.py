"""What a user may choose about a conversion, with defaults, units and where they come from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hric_control.errors import ParameterError
from hric_control.plants.friction import sigmoid_parameters

CHOICES = {
    "up": ("y", "z"),
    "inertia": ("refuse", "repair", "invent", "keep"),
    "names": ("refuse", "rename"),
    "friction": ("none", "coulomb", "sigmoid"),
}


@dataclass(frozen=True)
class Options:
    """Choices of `convert`.

    Attributes:
        name: name of the model; empty takes the robot's.
        up: axis of OpenSim's ground that points where z of the description does; OpenSim's custom: "y".
        gravity: acceleration in axes of the description's root link, three numbers [m/s^2]; the default is that of ROS's simulators.
        inertia: what becomes of inertias that no body has: "refuse"; "repair" (to the nearest that a body has);
            "invent" (the same, also where most of a robot's mass comes from the repair); "keep" (but zero ones).
        names: what becomes of names that OpenSim forbids: "refuse" or "rename".
        stops: joint stops act (CoordinateLimitForce).
        stop_stiffness: of a stop, beyond its transition [N m/rad]. Our choice: 100 N m (a Panda's largest effort) give 0.1 rad.
        stop_stiffness_linear: the same for prismatic joints [N/m]. Our choice: 100 N give 0.1 mm beyond the transition.
        stop_damping: of a stop [N m s/rad], our choice.
        stop_damping_linear: the same for prismatic joints [N s/m], our choice.
        stop_transition: angle over which a stop's stiffness grows from zero [rad], our choice.
        stop_transition_linear: the same for prismatic joints [m], our choice.
        damping: viscous damping of the description acts (SpringGeneralizedForce).
        friction: "none"; "coulomb", -f tanh(dq/v) with f of the description; "sigmoid", identified friction by `friction_parameters`.
        friction_velocity: v of Coulomb friction for all joints [rad/s or m/s]: a smaller one is more like real friction and costs smaller time steps;
            None: for each joint by `friction.transition_velocity`.
        friction_parameters: joint -> {phi1 [N m], phi2 [s/rad], phi3 [rad/s]} of the sigmoid, as `panda_description` has them.
        actuators: each driven coordinate has a CoordinateActuator with its effort limit.
        meshes: visual geometry is drawn.
        contact: contact geometry is made of the collision elements.
        folder: where relative addresses of meshes begin, usually the description's own; empty: the working folder.
    """

    name: str = ""
    up: str = "y"
    gravity: Sequence[float] = (0.0, 0.0, -9.81)
    inertia: str = "refuse"
    names: str = "refuse"
    stops: bool = True
    stop_stiffness: float = 1000.0
    stop_stiffness_linear: float = 1e6
    stop_damping: float = 10.0
    stop_damping_linear: float = 1000.0
    stop_transition: float = 0.01
    stop_transition_linear: float = 1e-4
    damping: bool = True
    friction: str = "coulomb"
    friction_velocity: float | None = None
    friction_parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    actuators: bool = True
    meshes: bool = True
    contact: bool = False
    folder: str = ""

    def __post_init__(self) -> None:
        for option, valid in CHOICES.items():
            if getattr(self, option) not in valid:
                raise ParameterError(f"option {option} is {getattr(self, option)!r}; valid: {', '.join(valid)}")
        for option in ("stop_stiffness", "stop_stiffness_linear", "stop_transition", "stop_transition_linear"):
            _positive(option, getattr(self, option))
        if self.friction_velocity is not None:
            _positive("friction_velocity", self.friction_velocity)
        for option in ("stop_damping", "stop_damping_linear"):
            _positive(option, getattr(self, option), zero=True)
        _numbers("gravity", self.gravity)
        if self.friction == "sigmoid":
            sigmoid_parameters(self.friction_parameters, list(self.friction_parameters))


def _positive(option: str, value: object, *, zero: bool = False) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not number or value < 0.0 or (value == 0.0 and not zero):  # type: ignore[operator]
        raise ParameterError(f"option {option} is {value!r}; it must be a number {'of at least' if zero else 'above'} 0")


def _numbers(option: str, values: object) -> None:
    if (
        isinstance(values, str)
        or not isinstance(values, Sequence)
        or len(values) != 3
        or not all(isinstance(value, int | float) and math.isfinite(value) for value in values)
    ):
        raise ParameterError(f"option {option} is {values!r}; it must be three finite numbers")
