"""ROS parameters of the real arm."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from franka_hw_interface.arm_parameters import ARM_ID, collision_config
from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.limits import FrankaLimits, fr3_limits, franka_limits
from hric_control.limits import ENFORCE_LIMITS
from hric_control.plants import rotor_inertia
from hric_core.node import REQUIRED
from hric_core.parameters import Settings as Base
from hric_core.parameters import choice, flag, number, package_yaml, text, whole
from hric_core.urdf import read

ROBOT_IP: Any = text(
    valid="an address, e.g. 172.16.0.2,", empty=False, name="robot_ip", text="address of the control box"
)
WAIT_FOR_ARM: Any = number(
    0.0,
    minimum=0.0,
    unit="s",
    name="wait_for_arm",
    text="time for which a refused connection is tried again, as while the control box starts",
)


@dataclass(frozen=True)
class FrankaRealSettings(Base):
    """Parameters of the robot node for a real arm; further defaults are in config/franka_real.yaml."""

    robot_ip: str = ROBOT_IP
    robot: str = choice("panda", "fr3", text="which arm")
    arm_id: str = ARM_ID
    model: str = choice(
        "kdl",
        "libfranka",
        text="model that controllers get: `kdl` from robot_description, or `libfranka`, the arm's own",
    )
    rate_limiting: bool = flag(text="libfranka's rate limiter")
    cutoff_frequency: float = number(above=0.0, unit="Hz", text="libfranka's low-pass on commands; 1000 or more: none")
    internal_controller: str = choice(
        "joint_impedance",
        "cartesian_impedance",
        default=REQUIRED,
        text="controller that follows position and velocity commands",
    )
    realtime_config: str = choice(
        "enforce", "ignore", default=REQUIRED, text="`enforce`: refuse a kernel without PREEMPT_RT"
    )
    collision_config: CollisionThresholds | None = collision_config(
        REQUIRED, "the arm's thresholds stay", "franka_ros'"
    )
    enforce_limits: tuple[str, ...] = ENFORCE_LIMITS
    rotor_inertia: float | None = number(
        None,
        minimum=0.0,
        unit="kg m^2",
        default_text="the description's",
        text="rotor inertia of each joint, for controllers that check their gains",
    )
    realtime_priority: int = whole(minimum=0, maximum=98, text="SCHED_FIFO priority of the loop; 0: none")
    lock_memory: bool = flag(text="keep the process from being paged out")
    switch_interval: float = number(above=0.0, unit="s", text="thread switch interval of Python")
    probe_timeout: float = number(above=0.0, unit="s", text="timeout of the first connection")
    wait_for_arm: float = WAIT_FOR_ARM
    watchdog_timeout: float = number(
        minimum=0.0, unit="s", text="silence of the loop after which the process is ended; 0: no watchdog"
    )
    watchdog_patience: float = number(
        above=0.0, unit="s", text="the same while the arm recovers, takes a setting or sends its model"
    )
    connect_timeout: float = number(above=0.0, unit="s", text="the same while libfranka connects")

    @property
    def limits(self) -> FrankaLimits:
        """Nominal limits of the arm, without libfranka's margins."""
        return fr3_limits() if self.robot == "fr3" else franka_limits()

    @classmethod
    def defaults(cls) -> Mapping[str, object]:
        """Return the default values from config/franka_real.yaml."""
        return package_yaml(__file__, "franka_real")

    @property
    def filters_poses(self) -> bool:
        """True if libfranka's control loop limits and filters poses; pylibfranka, for the FR3, has no such loop."""
        return self.robot == "panda"

    def rotors(self, urdf_xml: str, joint_names: Sequence[str]) -> tuple[float, ...]:
        """Return the joints' rotor inertia, n floats [kg m^2]: the parameter, or that of the robot description."""
        plant = {} if self.rotor_inertia is None else {"rotor_inertia": self.rotor_inertia}
        return rotor_inertia(plant, joint_names, read(urdf_xml))
