"""ROS node `emulated_arm`: serves an emulated arm, control box and hand to libfranka clients on the network.

Others can act in the arm's physics plant, e.g. an emulated human (parameter `participants`).
"""

import gc
import socket
import threading
from typing import Any

from franka_sim.buttons import Buttons
from franka_sim.fci.arm_input import PARAMETERS, read_arm
from franka_sim.fci.epoch import Epoch
from franka_sim.fci.server import FciServer
from franka_sim.fci.world_building import build_world, served_arms
from hric_control.clock_pairs import TOPIC
from hric_control.loop_requests import LoopRequests
from hric_core.processes import prefer_this_thread, quiet_collector
from hric_core.ros import RosNode, run
from hric_core.ros.process import NodeApp
from hric_msgs.msg import ClockPair

PERIOD = 0.2
"""Period of the check that the server still runs [s of wall time]."""
PATIENCE = 2.0
"""Maximum wait at shutdown for the server's last cycle [s of wall time]."""


class EmulatedArm(NodeApp):
    """Node with an emulated arm, which serves clients from its construction on: in lock-step, at most in real time.

    The arm has a hand if the robot description has one. ROS messages from the plant are stamped with the time of the
    run, as the client's driver publishes it.

    Raises:
        HricError: a parameter, a name, the description or a port cannot be used.
    """

    period = PERIOD

    def __init__(self, node: RosNode) -> None:
        given = {"arm": read_arm(node)}
        self._world = build_world(given, node)
        served = served_arms(given, self._world)["arm"]
        arm = self._world.arms[0]
        try:
            self._server = FciServer([served])
        except BaseException:
            self._world.close()
            raise
        self._epoch = Epoch(node.now().to_sec())
        self._world.on_cycle = self._epoch.on_cycle
        self._world.participants.set_epoch(self._epoch.value)
        self._pairs = node.subscribe(node.beside(TOPIC), ClockPair, self._on_pair, queue_size=0)
        self._failure: BaseException | None = None
        self._wake, waken = socket.socketpair()
        self._requests = LoopRequests(lambda: waken.send(b"."))
        self._server.watch(self._wake.fileno(), self._on_request)
        where = node.beside("franka_control")
        self._buttons = Buttons(node, where, arm.set_user_stop, arm.set_guiding, self._requests.request)
        self._thread = threading.Thread(target=self._serve, name="control box", daemon=True)
        self._thread.start()
        node.log_info(f"emulated arm waits for libfranka clients at {served.ip}, protocol {served.version}")

    def _serve(self) -> None:
        prefer_this_thread()
        gc.collect()
        gc.freeze()
        try:
            with quiet_collector(), self._requests.served_here():
                self._server.run()
        except BaseException as error:  # raised again by the main thread
            self._failure = error

    def _on_request(self, _: int) -> None:
        self._wake.recv(4096)
        self._requests.serve()

    def _on_pair(self, message: Any) -> None:
        if self._epoch.on_pair(message.monotonic, message.run_time.to_sec()):
            self._world.participants.set_epoch(self._epoch.value)

    def tick(self) -> None:
        """Raise the error that ended the server's thread, if any."""
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Stop the server and release the arm."""
        self._pairs.unregister()
        self._buttons.unregister()
        self._server.stop()
        self._thread.join(PATIENCE)
        self._server.close()
        self._world.close()


def main(text_of_help: str) -> int:
    """Run the node and return its exit code."""
    return run("emulated_arm", text_of_help, EmulatedArm, *PARAMETERS)
