"""The node `emulated_motive`: the command, in the time of the run where there is one."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
from collections.abc import Sequence

import rosgraph
import rospy

from hric_control.ros_logging import forward_to_ros
from hric_control.ros_node import RosNode
from mocap_natnet.run_time import RunTime
from mocap_natnet.server import app
from mocap_natnet.server.live_sources import LiveSources

NAME = "emulated_motive"


def main(words: Sequence[str] | None = None) -> int:
    """Run until told to end; without a master, or with --clock wall, as the command without ROS. Returns the exit code."""
    options = app.options_of(words)
    if options.clock == "wall" or not rosgraph.is_master_online():
        return app.main(words)

    def work() -> None:
        rospy.init_node(NAME, argv=sys.argv if words is None else [NAME, *words], disable_signals=True)
        forward_to_ros(logging.getLogger("hric"))
        node, serving = RosNode("~"), threading.Event()
        run_time = RunTime(node)
        live = LiveSources(node, run_time)
        rospy.on_shutdown(lambda: os.kill(os.getpid(), signal.SIGTERM) if serving.is_set() else None)  # `rosnode kill`
        try:
            serving.set()
            app.serve(options, run_time, run_time.tick, live)
        finally:
            serving.clear()
            live.close()
            run_time.close()
            rospy.signal_shutdown("told to end")

    return app.run(work)
