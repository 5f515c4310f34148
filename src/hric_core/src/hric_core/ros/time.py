"""ROS time in the process that publishes /clock.

If `/use_sim_time` is true, rospy subscribes to /clock. The process that publishes /clock knows the time already, and
receiving its own messages would take a twentieth of its computing time when it runs faster than real time. So it starts
without that subscription and sets rospy's clock itself.
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
        argv: words of the command line.

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
    """Set the time that `rospy.Time.now()` returns in this process, and wake threads in `rospy.sleep`.

    Args:
        stamp: new time (genpy.Time).
    """
    # This is what rospy's /clock callback does; that has no public name and spends most of its time on a warning.
    rostime = rospy.rostime
    with rostime._rostime_cond:
        rostime._rostime_current = rospy.Time(stamp.secs, stamp.nsecs)
        rostime._rostime_cond.notify_all()
