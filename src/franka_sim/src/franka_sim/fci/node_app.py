"""ROS node `emulated_arm`: serves an emulated arm, control box and hand to libfranka clients on the network.

Others can act in the arm's physics plant, e.g. an emulated human (parameter `participants`).
"""

import gc
import ipaddress
import socket
import threading
from dataclasses import dataclass
from typing import Any

from franka_sim.buttons import Buttons
from franka_sim.fci.arm_building import build_arm
from franka_sim.fci.epoch import Epoch
from franka_sim.fci.robots import ROBOTS
from franka_sim.fci.server import FciServer
from franka_sim.settings import BoxSettings, SimulatedArmSettings, read
from hric_control.clock_pairs import TOPIC
from hric_control.limits import check_start
from hric_control.loop_requests import LoopRequests
from hric_control.robot_settings import COMMON_PARAMETERS, RobotSettings
from hric_core.parameters import choice, text
from hric_core.processes import prefer_this_thread, quiet_collector
from hric_core.ros import RosNode, run
from hric_core.ros.process import NodeApp
from hric_msgs.msg import ClockPair

PERIOD = 0.2
"""Period of the check that the server still runs [s of wall time]."""
PATIENCE = 2.0
"""Maximum wait at shutdown for the server's last cycle [s of wall time]."""


@dataclass(frozen=True)
class EmulatedArmSettings(BoxSettings):
    """Parameters of the node emulated_arm: those of the simulated arm's plant and control box, and the network's."""

    ip: str = text(
        "127.0.0.1",
        valid="an IPv4 address of this machine, e.g. 127.0.0.2,",
        made=lambda address: str(ipaddress.IPv4Address(address)),
        text="address of the server, on libfranka's ports",
    )
    robot: str = choice("panda", "fr3", text="type of the arm; both use the description of the Panda")


class EmulatedArm(NodeApp):
    """Node with an emulated arm, which serves clients from its construction on: in lock-step, at most in real time.

    The arm has a hand if the robot description has one. ROS messages from the plant are stamped with the time of the
    run, as the client's driver publishes it.

    Raises:
        HricError: a parameter, a name, the description or a port cannot be used.
    """

    period = PERIOD

    def __init__(self, node: RosNode) -> None:
        settings, realism = read(node, EmulatedArmSettings)
        robot = ROBOTS[settings.robot]
        description = robot.limited(node.search_param("robot_description"), settings.arm_id)
        names = [f"{settings.arm_id}_joint{i}" for i in range(1, 8)]
        check_start(description, names, settings.q_start, node.resolve("q_start"))
        self._arm = build_arm(settings, realism, robot, description, node)
        try:
            self._server = FciServer(self._arm, settings.ip, robot.version)
        except BaseException:
            self._arm.close()
            raise
        self._epoch = Epoch(node.now().to_sec())
        self._arm.on_cycle = self._epoch.on_cycle
        self._arm.participants.set_epoch(self._epoch.value)
        self._pairs = node.subscribe(node.beside(TOPIC), ClockPair, self._on_pair, queue_size=0)
        self._failure: BaseException | None = None
        self._wake, waken = socket.socketpair()
        self._requests = LoopRequests(lambda: waken.send(b"."))
        self._server.watch(self._wake.fileno(), self._on_request)
        where = node.beside("franka_control")
        self._buttons = Buttons(node, where, self._arm.set_user_stop, self._arm.set_guiding, self._requests.request)
        self._thread = threading.Thread(target=self._serve, name="control box", daemon=True)
        self._thread.start()
        node.log_info(f"emulated {settings.robot} waits for libfranka clients at {settings.ip}")

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
            self._arm.participants.set_epoch(self._epoch.value)

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
        self._arm.close()


def main(text_of_help: str) -> int:
    """Run the node and return its exit code."""
    of_simulated_arm = (SimulatedArmSettings, RobotSettings, *COMMON_PARAMETERS)  # one parameter file serves both
    return run("emulated_arm", text_of_help, EmulatedArm, EmulatedArmSettings, *of_simulated_arm)
