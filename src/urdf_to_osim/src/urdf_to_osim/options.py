"""Options of a conversion to OpenSim, with defaults, units and sources."""

from collections.abc import Mapping
from dataclasses import dataclass

from hric_control.plants import sigmoid_parameters
from hric_core.parameters import Settings, choice, flag, mapping, number, numbers, text

CHOICES = {
    "up": ("y", "z"),
    "inertia": ("refuse", "repair", "invent", "keep"),
    "names": ("refuse", "rename"),
    "friction": ("none", "coulomb", "sigmoid"),
}


@dataclass(frozen=True)
class Options(Settings):
    """Options of the conversion of a robot description to an OpenSim model."""

    name: str = text("", text="name of the model; empty takes the robot's")
    up: str = choice(*CHOICES["up"], text="axis of OpenSim's ground that points where z of the description does")
    gravity: tuple[float, ...] = numbers(
        3,
        (0.0, 0.0, -9.81),
        unit="m/s^2",
        text="acceleration in axes of the description's root link; the default is that of ROS's simulators",
    )
    inertia: str = choice(
        *CHOICES["inertia"],
        text='treatment of inertias that no body has: "refuse"; "repair" (to the nearest that a body has); "invent" '
        '(the same, also where most of a robot\'s mass comes from the repair); "keep" (but zero ones)',
    )
    names: str = choice(*CHOICES["names"], text="treatment of names that OpenSim forbids")
    stops: bool = flag(True, text="joint stops act (CoordinateLimitForce)")
    stop_stiffness: float = number(
        1000.0,
        above=0.0,
        unit="N m/rad",
        text="of a stop, beyond its transition; 100 N m, the largest effort of a Panda, give 0.1 rad "
        "(project default, unconfirmed)",
    )
    stop_stiffness_linear: float = number(
        1e6,
        above=0.0,
        unit="N/m",
        text="the same for prismatic joints. Project default, unconfirmed: 100 N give 0.1 mm beyond the transition",
    )
    stop_damping: float = number(10.0, minimum=0.0, unit="N m s/rad", text="of a stop, project default, unconfirmed")
    stop_damping_linear: float = number(
        1000.0, minimum=0.0, unit="N s/m", text="the same for prismatic joints, project default, unconfirmed"
    )
    stop_transition: float = number(
        0.01,
        above=0.0,
        unit="rad",
        text="angle over which a stop's stiffness grows from zero, project default, unconfirmed",
    )
    stop_transition_linear: float = number(
        1e-4, above=0.0, unit="m", text="the same for prismatic joints, project default, unconfirmed"
    )
    damping: bool = flag(True, text="viscous damping of the description acts (SpringGeneralizedForce)")
    friction: str = choice(
        *CHOICES["friction"],
        default="coulomb",
        text='"coulomb": -f tanh(dq/v) with f of the description; "sigmoid": identified friction by '
        "`friction_parameters`",
    )
    friction_velocity: float | None = number(
        None,
        above=0.0,
        unit="rad/s or m/s",
        text="v of Coulomb friction for all joints: a smaller one is more like real friction and costs smaller "
        "time steps; "
        "None: for each joint by `friction.transition_velocity`",
    )
    friction_parameters: Mapping[str, Mapping[str, float]] = mapping(
        default={},
        text="joint -> {phi1 [N m], phi2 [s/rad], phi3 [rad/s]} of the sigmoid, as `panda_description` has them",
    )
    actuators: bool = flag(True, text="each driven coordinate has a CoordinateActuator with its effort limit")
    meshes: bool = flag(True, text="visual geometry is drawn")
    contact: bool = flag(False, text="contact geometry is made of the collision elements")
    folder: str = text(
        "",
        text="where relative addresses of meshes begin, usually the description's own; empty: the working folder",
    )

    def check(self, where: str) -> None:
        """Raise an error if sigmoid friction is selected with incomplete parameters."""
        if self.friction == "sigmoid":
            sigmoid_parameters(self.friction_parameters, list(self.friction_parameters))
