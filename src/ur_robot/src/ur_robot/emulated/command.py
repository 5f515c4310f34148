"""Command `ur_controller`: emulates a UR arm with its controller as a server for ur_rtde."""

import argparse
import ipaddress
import logging
import math
import signal

import panda_description
from hric_control.hardware_interface import PositionJointInterface
from hric_control.limits import load_limits
from hric_control.plant import DEFAULT_PLANT
from hric_control.robot_hw import ControllerInfo
from hric_control.sim.robot_hw_sim import RobotHWSim
from hric_core.command import Argument, Command
from hric_core.errors import DescriptionError
from hric_core.local.node import LocalNode
from hric_core.parameters import text
from hric_core.processes import run_server
from ur_robot.emulated.control_program import JOINTS, PERIOD, UrController
from ur_robot.emulated.server import UrServer

UR5E = "package://hric_experiments/robots/ur5e.urdf.xacro"
Q_START = (math.pi, -math.pi / 2, math.pi / 2, -math.pi / 2, -math.pi / 2, 0.0)
"""Joint positions at the start [rad], those of the experiments with a UR5e."""


class EmulatedUr:
    """Simulated arm whose joints follow the target exactly, behind an emulated controller; 2 ms per cycle.

    Args:
        urdf: address of the description, a path or package://...; its joints are those with a transmission.
        plant: plugin type of the plant.
        q_start: joint positions at the start, 6 floats [rad].
        ip: address to listen on.
        real_time_factor: robot time per wall time.

    Attributes:
        controller: the emulated controller.

    Raises:
        HricError: the description or the plant cannot be used, or a port is not available.
    """

    def __init__(self, urdf: str, plant: str, q_start: list[float], ip: str, real_time_factor: float = 1.0) -> None:
        description = panda_description.load_file(urdf)
        robot = {"plant_type": plant, "plant": {"time_step": PERIOD}, "real_time_factor": real_time_factor}
        # The controller has limits of its own, which cause protective stops.
        robot |= {"q_start": q_start, "enforce_limits": False}
        node = LocalNode({"robot_description": description, "robot": robot})
        self._hw = hw = RobotHWSim()
        hw.init(node, node.child("robot"))
        try:
            names = hw.states.names
            if len(names) != JOINTS:
                raise DescriptionError(f"{urdf} has {len(names)} joints with a transmission; an arm of UR has {JOINTS}")
            limits = load_limits(description, None, names, ("position", "velocity"))
            claims = {PositionJointInterface.cpp_name: frozenset(names)}
            hw.do_switch([ControllerInfo("servo", "servo", claims)], [])
            self._joints = hw.get(PositionJointInterface).group()
            self.controller = UrController(q_start, [(limit.lower, limit.upper, limit.velocity) for limit in limits])
            self._server = UrServer(self.controller, ip)
        except BaseException:
            hw.shutdown()
            raise

    def run(self) -> None:
        """Serve until `stop`."""
        self._hw.run(self._on_cycle)

    def _on_cycle(self, _time: float, _period: float, _reset: bool) -> bool:
        states, controller = self._hw.states, self.controller
        self._server.poll(controller.state(states.position, states.velocity, states.effort))
        self._joints.set_command(controller.cycle())
        return True

    def stop(self) -> None:
        """Let `run` return; from any thread or a signal handler."""
        self._hw.stop()

    def close(self) -> None:
        """Disconnect all clients, and release the ports and the plant."""
        self._server.close()
        self._hw.shutdown()


class UrControllerCommand(Command):
    """Emulate an arm of Universal Robots with its controller, to which an unmodified ur_rtde connects.

    Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("--ip", default="127.0.0.1", help="address to listen on (default: %(default)s)"),
            Argument(
                "--urdf", default=UR5E, metavar="FILE", help="URDF or xacro, path or package:// (default: the UR5e)"
            ),
            Argument(
                "--plant",
                default=DEFAULT_PLANT,
                metavar="PACKAGE/CLASS",
                help="plugin of the physics engine (default: %(default)s)",
            ),
            Argument(
                "--q-start",
                type=float,
                nargs=JOINTS,
                default=list(Q_START),
                metavar="RAD",
                help="joint positions at the start [rad]",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Serve until Ctrl-C or SIGTERM."""
        logging.basicConfig(level=logging.INFO, format="[%(levelname)s] %(message)s")
        return run_server("hric ur_controller", lambda: serve(arguments))


def serve(options: argparse.Namespace) -> None:
    """Run the emulated arm until SIGINT or SIGTERM. Raises HricError."""
    text(valid="an IPv4 address of this machine, e.g. 127.0.0.2", made=ipaddress.IPv4Address).checked(
        options.ip, "--ip"
    )
    arm = EmulatedUr(options.urdf, options.plant, options.q_start, options.ip)
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: arm.stop())
        logging.getLogger("hric.ur").info("emulated UR arm waits for ur_rtde at %s", options.ip)
        arm.run()
    finally:
        arm.close()
