"""Command `control_box`: emulates a Franka arm and its control box as a server for libfranka."""

import argparse
import gc
import ipaddress
import logging
import os
import signal
import sys
from collections.abc import Callable, Mapping

from franka_sim.fci.arguments import care_arguments, network_arguments, physics_arguments, robot_arguments
from franka_sim.fci.complaints import LOG
from franka_sim.fci.console import HELP, Console
from franka_sim.fci.device import ConstantDevice, Device
from franka_sim.fci.faults import NetworkFaults
from franka_sim.fci.robots import ROBOTS, RobotKind
from franka_sim.fci.server import FciArm, FciServer
from franka_sim.gripper import Gripper
from hric_core.command import Argument, Command
from hric_core.errors import CommandError, FailureError, HricError
from hric_core.parameters import text, whole
from hric_core.processes import run_server


def _check(options: argparse.Namespace) -> None:
    address = "an IPv4 address of this machine, e.g. 127.0.0.2"
    text(valid=address, made=ipaddress.IPv4Address).checked(options.ip, "--ip")
    whole(minimum=0, maximum=99).checked(options.priority, "--priority")
    whole(minimum=0).checked(options.max_lost_packets, "--max-lost-packets")


def _take_priority(priority: int) -> None:
    if not priority:
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        raise FailureError(
            f"real-time priority {priority} is not permitted: raise the limit (ulimit -r), or omit --priority"
        ) from None


def make_device(options: argparse.Namespace, robot: RobotKind) -> tuple[Device, Callable[[], None]]:
    """Return the emulated robot, and a function that releases its resources. Raises HricError."""
    if options.constant:
        if options.vacuum:
            raise CommandError("--vacuum needs physics, which --constant does not have; valid: without --constant")
        return ConstantDevice(robot.served_urdf(), None if options.no_hand else Gripper()), lambda: None
    from franka_sim.fci.world_building import make_arm  # engine and models are slow to import, and --help needs neither

    arm = make_arm(options, robot)
    return arm, arm.close


def _attach_console(server: FciServer, devices: Mapping[str, Device]) -> None:
    file = sys.stdin.fileno()
    server.watch(file, Console(devices, file, lambda: server.unwatch(file)).on_input)


Arms = tuple[Mapping[str, FciArm], Callable[[], None]]
"""Emulated arms by name, and a function that releases their resources."""


def serve(options: argparse.Namespace, make_arms: Callable[[argparse.Namespace], Arms]) -> None:
    """Run the server until SIGINT or SIGTERM, with the arms that `make_arms(options)` returns. Raises HricError."""
    _check(options)
    faults = NetworkFaults(options.latency, options.jitter, options.loss, options.seed, where="--")
    arms, close = make_arms(options)
    try:
        server = FciServer(list(arms.values()), options.clock, options.real_time_factor, faults)
    except HricError:
        close()
        raise
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: server.stop())
    try:
        if options.console:
            _attach_console(server, {name: arm.device for name, arm in arms.items()})
        _take_priority(options.priority)
        gc.collect()
        gc.freeze()  # existing objects are permanent; the cycle creates little garbage
        for name, arm in arms.items():
            LOG.info("%s at %s, protocol %d, %s clock", name, arm.ip, arm.version, options.clock)
        server.run()
    finally:
        server.close()
        close()


class ControlBoxCommand(Command):
    """Emulate a Panda or FR3: arm, control box and hand, to which an unmodified libfranka connects.

    Needs no ROS master.
    """

    epilog = f"With --console, these commands are read from the standard input:\n{HELP}"

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [*robot_arguments(), *physics_arguments(), *network_arguments(), *care_arguments()]

    def arms(self, options: argparse.Namespace) -> Arms:
        """Construct the emulated arms that the arguments describe. Raises HricError."""
        robot = ROBOTS[options.robot]
        device, close = make_device(options, robot)
        return {options.robot: FciArm(device, options.ip, robot.version)}, close

    def run(self, arguments: argparse.Namespace) -> int:
        """Serve until Ctrl-C or SIGTERM."""
        logging.basicConfig(level=logging.INFO, format="[%(levelname)s] %(message)s")
        return run_server("hric control_box", lambda: serve(arguments, self.arms))
