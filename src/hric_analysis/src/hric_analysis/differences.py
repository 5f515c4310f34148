"""Differences between a run and a reference set-up (that of the thesis), with their reasons."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_analysis.metrics import MotionMetrics
from hric_assessment.typed_json import Content
from hric_bags.run_file import NodeParameters, RobotDefinition
from hric_control.plant import DEFAULT_PLANT
from hric_core.parameters import read_yaml
from hric_run.definition.experiment import config_path

CHATTER = 0.1
"""Peak-to-peak torque at rest above which a control loop is reported as chattering [N m]."""


@dataclass(frozen=True)
class Difference:
    """One difference between a run and the reference set-up.

    Attributes:
        what: aspect that differs.
        reference: value of the reference set-up.
        here: value of this run.
        why: reason or consequence of the difference.
    """

    what: str
    reference: str
    here: str
    why: str


@dataclass(frozen=True)
class Setup:
    """Run and reference set-up to compare.

    Attributes:
        reference: reference set-up: contents of a file in config/references.
        robot: section `robot` of the run's experiment.
        controller: parameters of the controller of the first setpoint.
        metrics: metrics of the run.
    """

    reference: Content
    robot: RobotDefinition
    controller: NodeParameters
    metrics: MotionMetrics

    def description(self, key: str, default: Any) -> Any:
        """Return an argument of the robot description (xacro), or `default` if it is not set."""
        return (self.robot.get("description") or {}).get(key, default)

    def plant(self, key: str, default: Any) -> Any:
        """Return a parameter of the plant (physics simulation), or `default` if it is not set."""
        return (self.robot.get("plant") or {}).get(key, default)


Check = Callable[[Setup], Difference | None]
"""Function that compares one aspect of a run with the reference; returns None if there is no difference."""


def reference(name: str) -> Content:
    """Read a reference set-up from config/references."""
    data: Content = read_yaml(config_path("references") / f"{name}.yaml")
    return data


def compare(setup: Setup) -> tuple[Difference, ...]:
    """Return all differences from the reference: first those of the set-up, then those observed in the run."""
    results = (check(setup) for check in CHECKS)
    return tuple(difference for difference in results if difference is not None)


def _engine(setup: Setup) -> Difference:
    return Difference(
        "physics engine",
        setup.reference["engine"],
        setup.robot.get("plant_type") or DEFAULT_PLANT,
        "the reference integrates by a first-order method, this plant only with integrator: semi_implicit; "
        "contacts and joint stops are solved differently",
    )


def _robot_hw(setup: Setup) -> Difference:
    adds = "gravity added by the controller" if setup.controller.get("gravity") else "gravity compensated by the arm"
    return Difference(
        "robot interface",
        setup.reference["robot_hw"],
        f"{setup.robot['hw']}, {adds}",
        "same function; here the cycles in which a limit acts are counted",
    )


def _half_step(setup: Setup) -> Difference | None:
    if not setup.plant("half_step_readout", True):
        return None
    return Difference(
        "position read-out",
        "the engine's position at the end of its step",
        "position at the measuring instant, q - dt dq/2",
        "compensates the half step by which a semi-implicit integrator is ahead; plant parameter half_step_readout: "
        "false switches this off",
    )


def _inertials(setup: Setup) -> Difference | None:
    used = setup.description("inertials", "barycentric")
    if used == setup.reference["inertials"]:
        return Difference(
            "inertia tensors",
            "shifted by eq. 2",
            "the same values, without this shift",
            "the published tensors are about the centre of mass already; the shift breaks the triangle "
            "inequality of links 2 to 6 and leaves "
            "links 3, 4 and 6 not positive definite: such bodies do not exist, though the joint-space mass "
            "matrix stays positive definite",
        )
    return Difference(
        "inertia tensors",
        "shifted by eq. 2, links 2 to 6 not physical",
        f"{used}, as published",
        "the published tensors are about the centre of mass already; inertials:=thesis loads the values of the thesis",
    )


def _value(what: str, key: str, used: Callable[[Setup], Any], why: str) -> Check:
    """Return a check of one value of the run against `key` of the reference; `why` may name other reference keys."""

    def check(setup: Setup) -> Difference | None:
        there, here = setup.reference[key], used(setup)
        return None if here == there else Difference(what, str(there), str(here), why.format_map(setup.reference))

    return check


def _gains(setup: Setup) -> Difference | None:
    used = {key: setup.controller.get(key) for key in ("kp", "kd")}
    sets: Sequence[Mapping[str, float]] = setup.reference["gains"]
    if any(all(_same(used[key], gains[key]) for key in ("kp", "kd")) for gains in sets):
        return None
    listed = " or ".join(f"Kp {gains['kp']:g} Kd {gains['kd']:g}" for gains in sets)
    return Difference(
        "gains",
        listed,
        f"Kp {used['kp']} Kd {used['kd']}",
        "the thesis uses kp:=200 kd:=100 in ch. 4.4 and kp:=50 kd:=10 in listing 6",
    )


def _same(used: Any, expected: float) -> bool:
    values = used if isinstance(used, list) else list(used.values()) if isinstance(used, Mapping) else [used]
    return all(value == expected for value in values)


def _profile(setup: Setup) -> Difference | None:
    if not (setup.controller.get("profile") or {}).get("enabled", False):
        return None
    return Difference("setpoint", "raw step", "trapezoidal velocity profile", "profile:=false commands the raw step")


def _start(setup: Setup) -> Difference | None:
    used = setup.robot.get("q_start")
    there = [float(value) for value in setup.reference["q_start"]]
    values = list(used.values()) if isinstance(used, Mapping) else used
    if values is not None and [float(value) for value in values] == there:
        return None
    return Difference("start", str(there), str(values), "joint 4 at 0 is outside its range (at most -0.0698 rad)")


def _outside(setup: Setup) -> Difference | None:
    outside = {name: joint for name, joint in setup.metrics.joints.items() if joint.started_outside}
    if not outside:
        return None
    names = ", ".join(f"{name} by {joint.position_excess_max:.4f} rad at most" for name, joint in outside.items())
    return Difference(
        "joint limits at the start",
        "not mentioned",
        f"outside its range: {names}",
        "q = 0 is outside the joint ranges of the arm; here a joint outside its range accepts only inward effort, "
        "and its stop acts once the joint has been inside",
    )


def _clamped(setup: Setup) -> Difference | None:
    touched = setup.metrics.limits_touched
    if touched is None or not any(touched.values()):
        return None
    counts = ", ".join(f"{kind} {count}" for kind, count in touched.items() if count)
    cycles = setup.metrics.control_log.cycles
    return Difference(
        "limits that acted",
        "enforced by the hardware interface, not counted",
        f"{counts} joint cycles of {cycles} cycles",
        "order of the limits: position, velocity, effort, torque rate; the last one ensures that no other limit "
        "causes a higher rate",
    )


def _above(setup: Setup, key: str, bound: float) -> dict[str, float]:
    """Return a metric by joint, for the joints in which it is above `bound`."""
    values = {name: getattr(joint, key) or 0.0 for name, joint in setup.metrics.joints.items()}
    return {name: value for name, value in values.items() if value > bound}


def _overspeed(setup: Setup) -> Difference | None:
    listed = ", ".join(f"{name} {ratio:.2f} times" for name, ratio in _above(setup, "velocity_ratio", 1.0).items())
    why = "a raw step accelerates the joint so much that the torque rate limit prevents braking in time"
    reference = "enforced, overshoot not reported"
    return Difference("velocity limit", reference, f"exceeded: {listed}", why) if listed else None


def _chatter(setup: Setup) -> Difference | None:
    listed = ", ".join(f"{name} {ripple:.2f} N m" for name, ripple in _above(setup, "effort_ripple", CHATTER).items())
    why = (
        "derivative gains above 2 / dt / ((M+B)^-1)_ii make the sampled loop unstable; only the limits keep the torque "
        "bounded"
    )
    reference = "not reported; in ch. 5.4 Gazebo oscillates more than OpenSim"
    return Difference("torque at the end of the run", reference, f"peak to peak {listed}", why) if listed else None


CHECKS: tuple[Check, ...] = (
    _engine,
    _robot_hw,
    _half_step,
    _inertials,
    _value(
        "joint damping [N m s/rad]",
        "damping",
        lambda setup: setup.description("damping", 0.0),
        "damping:=1.0 is the value of the thesis",
    ),
    _value(
        "joint friction",
        "friction",
        lambda setup: setup.description("friction", "none"),
        "the model of the thesis has damping but no friction",
    ),
    _value(
        "rotor inertia [kg m^2]",
        "rotor_inertia",
        lambda setup: setup.plant("rotor_inertia", "the description's"),
        "without it a torque loop at 1 kHz is unstable above Kd {stable_kd_at_1khz:g} on this arm; rotor_inertia:=0 is "
        "the model of the thesis",
    ),
    _value(
        "self-collision",
        "self_collision",
        lambda setup: setup.plant("self_collision", True),
        "at q = 0 the hand collides with the forearm, so self-collision pushes the arm away from the start",
    ),
    _gains,
    _value(
        "rotatum saturation [N m/s]",
        "rotatum_limit",
        lambda setup: setup.controller.get("rotatum_limit", setup.reference["rotatum_limit"]),
        "0 switches it off, as in the comparison of thesis ch. 5.4",
    ),
    _profile,
    _start,
    _outside,
    _clamped,
    _overspeed,
    _chatter,
)
