"""Joint-space PD control with optional gravity compensation (thesis, eq. 3) and a limited torque rate."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from std_msgs.msg import Float64MultiArray

from control_msgs.msg import JointTrajectoryControllerState
from hric_control.controller import Controller
from hric_control.hardware_interface import EffortJointInterface
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import ScaledTime, SpeedScale, SpeedScaleInterface
from hric_controllers import parameters
from hric_controllers.dynamics import added_gravity, kd_check
from hric_controllers.joint.pd_law import PdLaw
from hric_controllers.state.messages import build_state
from hric_controllers.trajectory.trapezoid import TrapezoidProfile
from hric_core import realtime
from hric_core.errors import CommandError, ParameterError
from hric_core.node import LiveParameter, Node, ParameterValues
from hric_core.parameters import Settings, flag, names, number, per_joint, section

LARGEST_GAIN = 1e5
"""Upper end of the range of a gain in dynamic_reconfigure [N m/rad], [N m s/rad]; far above useful values."""


@dataclass(frozen=True)
class PdGains:
    """Stiffness kp [N m/rad] and damping kd [N m s/rad] of n joints."""

    kp: tuple[float, ...]
    kd: tuple[float, ...]


class LiveGains:
    """Gains of the joint PD controller as live parameters.

    `kp_<joint>` and `kd_<joint>` set one joint. `kp_all` and `kd_all` set all joints and show the maximum of them.

    Args:
        node: namespace of the controller.
        joints: names of the joints, in the order of the gains.
        gains: gains at the start.
    """

    def __init__(self, node: Node, joints: Sequence[str], gains: PdGains) -> None:
        self._node, self.gains = node, gains
        self._names = {
            kind: [f"{kind}_{re.sub(r'[^A-Za-z0-9_]', '_', joint)}" for joint in joints] for kind in ("kp", "kd")
        }

    def parameters(self) -> list[LiveParameter]:
        """Return the live parameters to offer, with the present gains as defaults."""
        values = self.values()
        unit = {"kp": "stiffness [N m/rad]", "kd": "damping [N m s/rad]"}
        return [
            LiveParameter(
                name,
                value,
                0.0,
                LARGEST_GAIN,
                f"{unit[name[:2]]}, not below zero" + ("; sets all joints" if name.endswith("_all") else ""),
            )
            for name, value in values.items()
        ]

    def values(self) -> dict[str, float]:
        """Return the present values of all live parameters."""
        result: dict[str, float] = {}
        for kind, gains in (("kp", self.gains.kp), ("kd", self.gains.kd)):
            result[f"{kind}_all"] = max(gains)
            result.update(zip(self._names[kind], gains, strict=True))
        return result

    def requested(self, values: ParameterValues) -> PdGains:
        """Return the gains that result from changed live parameters, without applying them; `values`: in range."""
        before = self.values()
        return PdGains(self._gains("kp", before, values), self._gains("kd", before, values))

    def _gains(self, kind: str, before: dict[str, float], values: ParameterValues) -> tuple[float, ...]:
        together = values.get(f"{kind}_all", before[f"{kind}_all"])
        if together != before[f"{kind}_all"]:
            return (float(together),) * len(self._names[kind])
        return tuple(float(values.get(name, before[name])) for name in self._names[kind])

    def publish_start(self) -> None:
        """Write the gains at the start to the parameter server under the names of the live parameters.

        Values that an earlier run of the controller left under these names are thus overwritten.

        Raises:
            ParameterError: some of the names exist on the parameter server, but not all. An earlier run leaves all, so
                the user has set these, and they would be overwritten.
        """
        values = self.values()
        there = [name for name in values if self._node.has_param(name)]
        if 0 < len(there) < len(values):
            raise ParameterError(
                f"{', '.join(map(self._node.resolve, there))} cannot be given before the start; valid: kp and kd, each "
                "one number, a list or a mapping by joint"
            )
        for name, value in values.items():
            self._node.set_param(name, value)


@dataclass(frozen=True)
class ProfileSettings(Settings):
    """Parameters of the trapezoidal velocity profile by which the joints move to a setpoint."""

    enabled: bool = flag(True, text="trapezoidal velocity profile for setpoints; false: setpoints act at once")
    velocity: tuple[float, ...] = per_joint(number(above=0.0, unit="rad/s"), 1.0)
    acceleration: tuple[float, ...] = per_joint(number(above=0.0, unit="rad/s^2"), 5.0)


@dataclass(frozen=True)
class PdSettings(parameters.LawSettings):
    """Parameters of the joint PD controller."""

    joints: tuple[str, ...] = names()
    kp: tuple[float, ...] = per_joint(number(minimum=0.0, unit="N m/rad"), text="stiffness")
    kd: tuple[float, ...] = per_joint(number(minimum=0.0, unit="N m s/rad"), text="damping")
    rotatum_limit: float = number(1000.0, minimum=0.0, unit="N m/s", text="largest rate of torque; 0: no limit")
    profile: ProfileSettings = section(ProfileSettings)
    setpoint: tuple[float, ...] | None = per_joint(
        number(unit="rad"), None, text="setpoint at the start; none: the arm holds its position"
    )
    strict_gains: bool = parameters.STRICT_GAINS
    gain_ramp: float = number(1.0, minimum=0.0, maximum=60.0, unit="s", text="time in which live gains take over")
    state_publish_rate: float = parameters.state_rate(100.0)


class JointPDController(Controller):
    """Joint PD controller: tau = Kp (q_d - q) - Kd dq, plus g(q) if the parameter `gravity` is true.

    INTERFACE.md lists its parameters and topics.
    """

    settings = (PdSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise the topics.

        An error in a parameter or interface thus leaves no topic behind.
        """
        node = self._node = controller_node
        settings = PdSettings.read(node)
        self.joints = list(settings.joints)
        self._group = robot_hw.get(EffortJointInterface).group(self.joints)
        self._live = LiveGains(node, self.joints, PdGains(settings.kp, settings.kd))
        self._law = PdLaw(settings.kp, settings.kd, settings.rotatum_limit, settings.gain_ramp)
        self._gravity = added_gravity(robot_hw, root_node, node, self.joints) if settings.gravity else None
        self._check_kd = kd_check(robot_hw, root_node, node, self.joints, settings.rotor_inertia, settings.strict_gains)
        self._check_kd(settings.kd)
        self._profile = TrapezoidProfile(settings.profile.velocity, settings.profile.acceleration)
        self._go = self._profile.plan if settings.profile.enabled else self._profile.hold
        # Only a profile can be slowed down: setpoints that act at once ignore the speed scale, without a message.
        scale = robot_hw.get(SpeedScaleInterface).handle() if settings.profile.enabled else SpeedScale()
        self._along = ScaledTime(scale)
        self._ranges = parameters.position_ranges(root_node, self.joints)
        self._initial = parameters.initial_setpoint(
            settings.setpoint, self.joints, self._ranges, node.resolve("setpoint")
        )
        self._setpoint: realtime.LatestValue[list[float] | None] = realtime.LatestValue(None)
        self._new_gains: realtime.LatestValue[Any] = realtime.LatestValue(None)
        self._state_time = realtime.Throttle(settings.state_publish_rate)
        self._running = False
        self._open()

    def _open(self) -> None:
        node = self._node
        self._live.publish_start()
        self._state = realtime.publisher(node, "state", JointTrajectoryControllerState)
        node.live_parameters(self._live.parameters(), self._on_gains)
        node.subscribe("command", Float64MultiArray, self._on_command, queue_size=1)

    def _on_command(self, message: Any) -> None:
        """Check a setpoint and pass it to the loop.

        Raises:
            CommandError: the setpoint is refused; the node logs the error's text with the topic's name.
        """
        if not self._running:
            raise CommandError("the controller is not running, the setpoint is ignored; start it first")
        try:
            self._setpoint.set(parameters.check_setpoint(message.data, self.joints, self._ranges))
        except CommandError as error:
            raise CommandError(f"setpoint refused, the present one is kept: {error}") from None

    def _on_gains(self, values: ParameterValues) -> ParameterValues:
        """Check changed live parameters, pass the gains to the loop and return the applied values.

        Raises:
            HricError: a derivative gain is too large and `strict_gains` is set; no gain is changed then.
        """
        requested = self._live.requested(values)
        if requested != self._live.gains:
            self._check_kd(requested.kd)
            self._live.gains = requested
            self._new_gains.set(requested)
        return dict(self._live.values())

    def starting(self, time: float) -> None:
        """Hold the present position, or move to the parameter `setpoint`."""
        q = self._group.positions()
        # An arm that compensates gravity starts from zero torque; any other needs g(q) from the first cycle on.
        self._law.start(self._gravity(q) if self._gravity else [0.0] * len(q))
        self._setpoint.take_new()
        self._along.restart(time)
        self._profile.hold(time, q)
        if self._initial is not None:
            self._go(time, self._initial)
        self._state_time.restart()
        self._running = True

    def update(self, time: float, period: float) -> None:
        """Compute and command the torques of one cycle."""
        along = self._along.along(time, period)
        setpoint = self._setpoint.take_new()
        if setpoint is not None:
            self._go(along, setpoint)
        gains = self._new_gains.take_new()
        if gains is not None:
            self._law.change_gains(time, gains.kp, gains.kd)
        group = self._group
        q, dq = group.positions(), group.velocities()
        q_d, dq_d = self._profile.sample(along)
        tau = self._law.torque(time, period, q, dq, q_d, self._gravity)
        group.set_command(tau)
        if self._state_time.due(time):
            scale = self._along.scale.value
            self._publish(q, dq, q_d, dq_d if scale == 1.0 else [scale * v for v in dq_d], tau)

    def _publish(self, q: list[float], dq: list[float], q_d: list[float], dq_d: list[float], tau: list[float]) -> None:
        stamp, efforts = self._node.now(), self._group.efforts()
        self._state.publish(
            build_state, JointTrajectoryControllerState, stamp, self.joints, (q_d, dq_d, [], tau), (q, dq, [], efforts)
        )

    def stopping(self, time: float) -> None:
        """Stop accepting setpoints."""
        self._running = False
