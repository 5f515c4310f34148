"""Parameters of the Cartesian impedance controller."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from hric_controllers.parameters import ArmSettings, LawSettings, initial_setpoint, position_ranges, state_rate
from hric_core.live import live_parameters
from hric_core.node import Node, OnChange
from hric_core.parameters import Settings, declared, names, number, per_joint, refuse_void, refused, section, text

DEFLECTION = "error of {} beyond which the force of the spring no longer grows; 0: no limit"


def _refuse_unused(option: Settings, switch: float, where: str, needed: str) -> None:
    """Refuse values of an option that is off, as its `switch` is 0; needed: setting that turns it on."""
    for name in declared(type(option)) if switch == 0.0 else ():
        refuse_void(option, name, where, f"{where}{needed}")


@dataclass(frozen=True)
class ErrorLimitSettings(Settings):
    """Largest deflection of the spring, as in crisp_controllers (`error_clip`) and serl_franka_controllers.

    Those limit each axis; here the length of the vector is limited, so that the force keeps its direction.
    """

    translation: float = number(0.0, minimum=0.0, maximum=1.0, unit="m", text=DEFLECTION.format("position"))
    rotation: float = number(0.0, minimum=0.0, maximum=math.pi, unit="rad", text=DEFLECTION.format("orientation"))

    def limits(self) -> tuple[float, float]:
        """Return the limits of position [m] and rotation [rad]; infinite: none."""
        return self.translation or math.inf, self.rotation or math.inf


@dataclass(frozen=True)
class JointRepulsionSettings(Settings):
    """Torque that keeps the joints away from the ends of their ranges, as in crisp_controllers and franky.

    Sources: the default of the torque is crisp_controllers' `joint_limit_repulsion/max_torque`, its maximum the same;
    the damping and its maximum are project defaults, unconfirmed.
    """

    margin: float = number(
        0.0,
        minimum=0.0,
        maximum=1.0,
        unit="rad",
        text="distance from the ends of the joints' position ranges where the repulsion begins, such as 0.1; 0: none",
    )
    torque: float = number(5.0, above=0.0, maximum=50.0, unit="N m", text="torque at the end of the range and beyond")
    damping: float = number(
        1.0,
        minimum=0.0,
        maximum=10.0,
        unit="N m s/rad",
        text="damping at the end of the range; inside the margin in proportion to the depth",
    )

    def check(self, where: str) -> None:
        """Refuse a torque or damping without a margin."""
        _refuse_unused(self, self.margin, where, "margin above 0 [rad]")

    def check_ranges(self, where: str, joints: Sequence[str], ranges: Sequence[tuple[float, float]]) -> None:
        """Refuse a margin without position ranges, and one that leaves no room between the ends of a range."""
        if not any(math.isfinite(high - low) for low, high in ranges):
            raise refused(where, self.margin, "0, as robot_description gives no position range of these joints")
        joint, width = min(
            ((joint, high - low) for joint, (low, high) in zip(joints, ranges, strict=True)), key=lambda pair: pair[1]
        )
        if 2.0 * self.margin >= width:
            raise refused(where, self.margin, f"below {0.5 * width:.3g} rad, half of the range of {joint}")


@dataclass(frozen=True)
class FeedForwardSettings(Settings):
    """Wrench of a topic that is added to the law. All defaults and maxima are project defaults, unconfirmed."""

    timeout: float = number(
        0.0,
        minimum=0.0,
        maximum=1.0,
        unit="s",
        text="time without a new wrench after which the last one ends; 0: there is no topic `feedforward_wrench`",
    )
    largest_force: float = number(
        30.0, minimum=0.0, maximum=100.0, unit="N", text="largest force; a larger one is refused"
    )
    largest_torque: float = number(
        5.0, minimum=0.0, maximum=20.0, unit="N m", text="largest torque; a larger one is refused"
    )

    def check(self, where: str) -> None:
        """Refuse limits of a wrench that has no topic."""
        _refuse_unused(self, self.timeout, where, "timeout above 0 [s]")


@dataclass(frozen=True)
class EnergyTankSettings(Settings):
    """Energy tank. All defaults and maxima are project defaults, unconfirmed."""

    initial: float = number(
        0.0,
        minimum=0.0,
        maximum=100.0,
        unit="J",
        text="energy at the start: what the controller may give to the arm beyond what it gets; 0: no tank",
    )
    largest: float = number(10.0, above=0.0, maximum=100.0, unit="J", text="energy of a full tank, which takes no more")

    def check(self, where: str) -> None:
        """Refuse an initial energy that the tank cannot hold, and a size without an initial energy."""
        _refuse_unused(self, self.initial, where, "initial above 0 [J]")
        if self.initial > self.largest:
            raise refused(f"{where}initial", self.initial, f"up to {self.largest:g} J (largest)")


@dataclass(frozen=True)
class CartesianImpedanceSettings(LawSettings, ArmSettings):
    """Parameters of the Cartesian impedance controller, except for its gains and its equilibrium's input."""

    joints: tuple[str, ...] = names(
        range(1, 8), name="joint_names", text="`<arm_id>_joint1` to 7, or up to 7 joints of another arm, in order"
    )
    end_effector: str = text(
        "", text="link that the controller moves, of an arm other than Franka's; empty: the end effector of `arm_id`"
    )
    nullspace_posture: tuple[float, ...] | None = per_joint(
        number(unit="rad"),
        None,
        default_text="where the arm is at the start",
        text="posture that the null space controls",
    )
    filter_time: float = number(
        0.2, minimum=0.0, unit="s", text="time constant with which equilibrium and live gains take over; 0: at once"
    )
    rotatum_limit: float = number(1000.0, minimum=0.0, unit="N m/s", text="largest rate of torque; 0: no limit")
    state_publish_rate: float = state_rate(100.0)
    error_limit: ErrorLimitSettings = section(ErrorLimitSettings)
    joint_repulsion: JointRepulsionSettings = section(JointRepulsionSettings)
    feedforward: FeedForwardSettings = section(FeedForwardSettings)
    energy_tank: EnergyTankSettings = section(EnergyTankSettings)

    def check(self, where: str) -> None:
        """Raise an error if the joints are not in the order of the Jacobian's columns."""
        expected = tuple(f"{self.arm_id}_joint{i}" for i in range(1, 8))
        if not self.end_effector and self.joints != expected:
            valid = (
                f"the arm's joints in order, {', '.join(expected)}; joints of another arm: only if end_effector is set"
            )
            raise refused(f"{where}joint_names", list(self.joints), valid)

    def posture(self, root_node: Node, node: Node) -> list[float] | None:
        """Return the null-space posture, n floats [rad]; None: use that at the start. Raises ParameterError."""
        ranges = position_ranges(root_node, self.joints)
        return initial_setpoint(self.nullspace_posture, self.joints, ranges, node.resolve("nullspace_posture"))


@dataclass(frozen=True)
class ComplianceSettings(Settings):
    """Live parameters of the Cartesian impedance controller: stiffnesses and damping ratios, as in `Compliance`.

    Sources: the defaults and the maximum null-space stiffness are those of franka_ros's
    CartesianImpedanceExampleController; the maximum Cartesian stiffnesses are those that libfranka allows for the arm's
    internal impedance (setCartesianImpedance); the maximum damping ratio of 2 is a project default, unconfirmed.
    """

    translational_stiffness: float = number(
        200.0, minimum=0.0, maximum=3000.0, live=True, unit="N/m", text="stiffness of the end effector's position"
    )
    rotational_stiffness: float = number(
        10.0, minimum=0.0, maximum=300.0, live=True, unit="N m/rad", text="stiffness of the end effector's orientation"
    )
    translational_damping_ratio: float = number(
        1.0, minimum=0.0, maximum=2.0, live=True, text="times 2 sqrt(translational_stiffness) gives the damping [N s/m]"
    )
    rotational_damping_ratio: float = number(
        1.0,
        minimum=0.0,
        maximum=2.0,
        live=True,
        text="times 2 sqrt(rotational_stiffness) gives the damping [N m s/rad]",
    )
    nullspace_stiffness: float = number(
        0.5,
        minimum=0.0,
        maximum=100.0,
        live=True,
        unit="N m/rad",
        text="stiffness of the posture in the null space, damped by 2 sqrt(it)",
    )

    def offer(self, node: Node, on_change: OnChange) -> None:
        """Offer the live parameters; values that an earlier run left on the server do not override the YAML."""
        for name, value in asdict(self).items():
            node.set_param(name, value)
        node.live_parameters(live_parameters(self), on_change)
