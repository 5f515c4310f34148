"""ROS time in the process that publishes it.

A node under `use_sim_time` subscribes to /clock. The process that publishes /clock knows the time already, and
receiving its own messages costs it a twentieth of its time when it runs faster than real time. So it starts without
that subscription and sets the clock of rospy itself.
"""

from collections.abc import Sequence
from typing import Any

import rosgraph
import rospy
from rospy.impl import simtime

from hric_core.robot_time import stamps


def init_clock_node(name: str, argv: Sequence[str]) -> bool:
    """Call `rospy.init_node` without a subscription to /clock and without signal handlers.

    Args:
        name: default name of the node.
        argv: the command line.

    Returns:
        True if the other nodes use /clock (`/use_sim_time` is true).
    """
    master = rosgraph.Master(f"/{name}")
    simulated = master.hasParam("/use_sim_time") and master.getParam("/use_sim_time") is True
    # rospy reads the parameter by its absolute name, which no remapping reaches, and subscribes to /clock if it is
    # true.
    simtime._is_use_simtime = lambda: False
    rospy.init_node(name, argv=list(argv), disable_signals=True)
    if simulated:
        set_time(stamps.FIRST)
    return simulated


def set_time(stamp: Any) -> None:
    """Set the result of `rospy.Time.now()` in this process, and wake threads that sleep by it.

    Args:
        stamp: genpy.Time.
    """
    # The same as rospy's /clock callback, which has no public name and spends most of its time on a warning.
    rostime = rospy.rostime
    with rostime._rostime_cond:
        rostime._rostime_current = rospy.Time(stamp.secs, stamp.nsecs)
        rostime._rostime_cond.notify_all()
