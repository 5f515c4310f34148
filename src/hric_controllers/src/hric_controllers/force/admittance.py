"""Admittance controller: a person leads the end effector by hand as if it were a virtual mass with damping."""

import math
from dataclasses import dataclass

from geometry_msgs.msg import PoseStamped, WrenchStamped

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface
from hric_control.controller import Controller
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_controllers import parameters
from hric_controllers.cartesian.workspace import Box
from hric_controllers.force.admittance_law import AdmittanceLaw, VirtualAxis
from hric_controllers.force.wrench import TaredWrench
from hric_controllers.marker.parameters import Rotation, Translation, Workspace, check_arm_limits
from hric_core import realtime
from hric_core.geometry import Pose, quaternions, stamped
from hric_core.node import Node
from hric_core.parameters import Settings, choice, listing, number, section

AXES = ("x", "y", "z", "rx", "ry", "rz")
"""Names of the axes: translation along, and rotation about, the axes of `<arm_id>_link0`."""


@dataclass(frozen=True)
class AdmittanceSettings(Settings):
    """Parameters of the admittance controller. All defaults are project defaults, unconfirmed."""

    mass: float = number(8.0, minimum=1.0, maximum=100.0, unit="kg", text="virtual mass of the end effector")
    inertia: float = number(0.3, minimum=0.05, maximum=10.0, unit="kg m^2", text="virtual inertia of the end effector")
    damping: float = number(40.0, minimum=1.0, maximum=1000.0, unit="N s/m", text="virtual damping of translation")
    rotational_damping: float = number(
        3.0, minimum=0.1, maximum=100.0, unit="N m s/rad", text="virtual damping of rotation"
    )
    stiffness: float = number(
        0.0, minimum=0.0, maximum=3000.0, unit="N/m", text="virtual spring to the position at the start; 0: none"
    )
    force_dead_band: float = number(
        2.0,
        minimum=0.0,
        maximum=50.0,
        unit="N",
        text="dead band of the force along each axis; subtracted from larger forces",
    )
    torque_dead_band: float = number(
        0.5,
        minimum=0.0,
        maximum=20.0,
        unit="N m",
        text="dead band of the torque about each axis; subtracted from larger torques",
    )
    filter_time: float = number(
        0.01, minimum=0.0, maximum=0.1, unit="s", text="time constant of the low-pass filter of the wrench; 0: none"
    )
    tare_time: float = number(
        0.2,
        minimum=0.001,
        maximum=5.0,
        unit="s",
        text="time after the start during which the arm holds still and must not be touched; the mean estimated wrench "
        "of its second half is subtracted from then on",
    )
    locked: tuple[str, ...] = listing(
        choice(*AXES),
        default=(),
        different=True,
        text="axes of `<arm_id>_link0` along or about which the end effector does not move: `[z]` leaves motion in a "
        "plane, `[y, z]` along a line; `[rx, ry, rz]` keeps the orientation of the start",
    )
    largest_turn: float = number(
        1.0, above=0.0, maximum=3.0, unit="rad", text="largest rotation about each axis from the start"
    )
    translation: Translation = section(Translation)
    rotation: Rotation = section(Rotation)
    workspace: Box = section(Workspace)
    state_publish_rate: float = parameters.state_rate(100.0)

    def check(self, where: str) -> None:
        """Raise ParameterError if a limit of translation or rotation is above that of the arm."""
        check_arm_limits(where, self.translation, self.rotation)

    def axes(self) -> list[VirtualAxis]:
        """Return the six virtual axes, translation first."""
        linear, angular = self.translation.each_of(3), self.rotation.each_of(3)
        values = [
            (self.mass, self.damping, self.stiffness, self.force_dead_band, linear),
            (self.inertia, self.rotational_damping, 0.0, self.torque_dead_band, angular),
        ]
        return [
            VirtualAxis(math.inf if name in self.locked else mass, d, k, band, top.velocity, top.acceleration, top.jerk)
            for index, name in enumerate(AXES)
            for mass, d, k, band, top in values[index // 3 : index // 3 + 1]
        ]


class AdmittanceController(Controller):
    """Controller whose end effector yields to the estimated external wrench; it commands Cartesian poses.

    INTERFACE.md lists its parameters and topics; `force.admittance_law` computes the motion.
    """

    settings = (parameters.ArmSettings, AdmittanceSettings)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise the topics.

        An error in a parameter or interface thus leaves no topic behind.
        """
        node = self._node = controller_node
        arm_id = parameters.ArmSettings.read(node).arm_id
        self._settings = settings = AdmittanceSettings.read(node)
        self._base = f"{arm_id}_link0"
        self._arm = robot_hw.get(FrankaPoseCartesianInterface).handle(f"{arm_id}_robot")
        self._scale = robot_hw.get(SpeedScaleInterface).handle()
        self._law = AdmittanceLaw(settings.axes(), settings.filter_time)
        self._wrench = TaredWrench(settings.tare_time)
        self._state_time = realtime.Throttle(settings.state_publish_rate)
        self._desired = realtime.publisher(node, "desired_pose", PoseStamped)
        self._felt = realtime.publisher(node, "wrench", WrenchStamped)

    def starting(self, time: float) -> None:
        """Hold the last commanded pose, and start the tare of the wrench (parameter `tare_time`)."""
        settings, T = self._settings, self._arm.robot_state.O_T_EE_c
        self._columns = [(T[k], T[k + 1], T[k + 2]) for k in (0, 4, 8)]
        self._start = Pose.of_column_major(T)
        self._rotation = quaternions.from_rotation_vector((0.0, 0.0, 0.0))
        box, p = settings.workspace, self._start.position
        # From outside, the arm must not move by itself into the workspace.
        reach = [(min(lo - x, 0.0), max(hi - x, 0.0)) for lo, hi, x in zip(box.lower, box.upper, p, strict=True)]
        self._law.start([*reach, *[(-settings.largest_turn, settings.largest_turn)] * 3])
        self._wrench.start()
        self._state_time.restart()

    def update(self, time: float, period: float) -> None:
        """Advance the virtual mass by one cycle and command its pose.

        Raises:
            FailureError: the estimated external wrench is not finite.
        """
        law, exerted = self._law, self._wrench.advance(self._arm.robot_state.O_F_ext_hat_K, period)
        if exerted is not None:
            law.advance([-value for value in exerted], period, self._scale.value)
        a, b, c = (period * rate for rate in law.velocity[3:])
        self._rotation = quaternions.product(quaternions.from_rotation_vector((a, b, c)), self._rotation)
        columns = [quaternions.rotated(self._rotation, column) for column in self._columns]
        x, y, z = (start + moved for start, moved in zip(self._start.position, law.position, strict=False))
        self._arm.set_command([*columns[0], 0.0, *columns[1], 0.0, *columns[2], 0.0, x, y, z, 1.0])
        if self._state_time.due(time):
            pose = Pose((x, y, z), quaternions.product(self._rotation, self._start.orientation))
            header = stamped.header(self._node.now(), self._base)
            self._desired.publish(stamped.pose_stamped, header, pose)
            self._felt.publish(stamped.wrench_stamped, header, law.wrench)
