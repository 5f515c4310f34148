"""ROS parameters of an arm of Universal Robots."""

from dataclasses import dataclass
from typing import Any

from hric_control.limits import ENFORCE_LIMITS
from hric_core.parameters import Settings, flag, number, text, whole

ROBOT_IP: Any = text(
    valid="an address, e.g. 192.168.56.101,", empty=False, name="robot_ip", text="address of the controller"
)


@dataclass(frozen=True)
class UrSettings(Settings):
    """Parameters of the robot node for an arm of Universal Robots.

    Defaults of `lookahead_time` and `gain` are those of ur_rtde's examples; all others are project defaults, unconfirmed.
    """

    robot_ip: str = ROBOT_IP
    lookahead_time: float = number(
        0.1, minimum=0.03, maximum=0.2, unit="s", text="smoothing of `servoj`: a larger value is smoother and later"
    )
    gain: float = number(300.0, minimum=100.0, maximum=2000.0, text="proportional gain of `servoj`")
    lost_after: float = number(
        0.1, above=0.0, maximum=1.0, unit="s", text="silence of the controller after which the connection is lost"
    )
    probe_timeout: float = number(1.0, above=0.0, unit="s", text="timeout of the first connection")
    enforce_limits: tuple[str, ...] = ENFORCE_LIMITS
    realtime_priority: int = whole(80, minimum=0, maximum=98, text="SCHED_FIFO priority of the loop; 0: none")
    lock_memory: bool = flag(True, text="keep the process from being paged out")
    switch_interval: float = number(0.0005, above=0.0, unit="s", text="thread switch interval of Python")
