"""Arguments of the command `control_box`."""

import argparse
from typing import Any

from franka_sim.fci.robots import MAX_LOST_PACKETS, ROBOTS
from franka_sim.realism import IDEAL
from franka_sim.settings import Q_START
from hric_control.plant import DEFAULT_PLANT
from hric_core import yaml_text
from hric_core.command import Argument
from hric_core.errors import ParameterError

PHYSICS = "physics"
NETWORK = "faults of the network, in each direction"
CARE = "protection, operation, measurement"
"""Groups of the arguments in --help."""


def yaml_value(text: str) -> Any:
    """Return an argument of the command line, parsed as YAML."""
    try:
        return yaml_text.parse(text, repr(text))
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def robot_arguments() -> list[Argument]:
    """Return the arguments of the robot and its clock."""
    return [
        Argument(
            "--ip",
            default="127.0.0.1",
            help="address to listen on (default: %(default)s, this machine only; several robots: 127.0.0.2, "
            "127.0.0.3, ...)",
        ),
        Argument(
            "--robot",
            choices=tuple(ROBOTS),
            default="panda",
            help="panda: protocol 5, libfranka 0.9; fr3: protocol 10, libfranka 0.18 or later (default: %(default)s)",
        ),
        Argument(
            "--clock",
            choices=("lock_step", "wall"),
            default="lock_step",
            help="lock_step: robot time stops until the client's command has come; wall: it goes on (default: "
            "%(default)s)",
        ),
        Argument(
            "--real-time-factor",
            type=float,
            default=1.0,
            metavar="X",
            help="robot time per wall time; 0, with lock_step only: as fast as the client (default: %(default)s)",
        ),
        Argument("--no-hand", action="store_true", help="emulate the arm without a hand"),
        Argument("--vacuum", action="store_true", help="emulate the arm with a vacuum gripper in place of the hand"),
        Argument(
            "--q-start", type=float, nargs=7, default=list(Q_START), metavar="RAD", help="initial joint positions [rad]"
        ),
    ]


def physics_arguments() -> list[Argument]:
    """Return the arguments of the physics simulation."""
    return [
        Argument(
            "--plant",
            group=PHYSICS,
            default=DEFAULT_PLANT,
            metavar="PACKAGE/CLASS",
            help="physics plugin (default: %(default)s)",
        ),
        Argument(
            "--rotor-inertia",
            group=PHYSICS,
            type=float,
            metavar="KGM2",
            help="rotor inertia of each joint [kg m^2], in the physics and in the control box (default: the "
            "description's)",
        ),
        Argument(
            "--friction",
            group=PHYSICS,
            choices=("none", "identified"),
            help="joint friction in the physics; --realism sets the default and the share that the box compensates",
        ),
        Argument(
            "--realism",
            group=PHYSICS,
            type=yaml_value,
            default=IDEAL,
            metavar="PRESET",
            help="sensor noise, and differences between the arm and the control box's model: ideal, measured, or e.g. "
            "{preset: measured, dq_noise: 0} (default: %(default)s)",
        ),
        Argument(
            "--no-collision", group=PHYSICS, action="store_true", help="let the arm pass through itself and objects"
        ),
        Argument(
            "--world",
            group=PHYSICS,
            default="",
            metavar="FILE",
            help="file of objects around the arm, path or package://PACKAGE/FILE (if the physics plugin has worlds)",
        ),
        Argument("--gui", group=PHYSICS, action="store_true", help="open the window of the physics engine"),
    ]


def network_arguments() -> list[Argument]:
    """Return the arguments of the emulated network faults."""
    return [
        Argument(
            "--latency", group=NETWORK, type=float, default=0.0, metavar="S", help="constant delay of datagrams [s]"
        ),
        Argument(
            "--jitter",
            group=NETWORK,
            type=float,
            default=0.0,
            metavar="S",
            help="maximum random delay in addition to the latency [s]",
        ),
        Argument(
            "--loss", group=NETWORK, type=float, default=0.0, metavar="SHARE", help="share of datagrams lost, 0 to 1"
        ),
        Argument(
            "--seed",
            group=NETWORK,
            type=int,
            default=0,
            metavar="N",
            help="random seed of the network faults and of the sensor noise",
        ),
    ]


def care_arguments() -> list[Argument]:
    """Return the arguments of the protection and operation of the robot."""
    return [
        Argument(
            "--no-reflexes",
            group=CARE,
            action="store_true",
            help="do not end motions at collisions and violated limits",
        ),
        Argument(
            "--max-lost-packets",
            group=CARE,
            type=int,
            default=MAX_LOST_PACKETS,
            metavar="N",
            help="number of consecutive lost commands that ends a motion; 0: no limit (default: %(default)s)",
        ),
        Argument("--console", group=CARE, action="store_true", help="read commands from the standard input"),
        Argument(
            "--priority",
            group=CARE,
            type=int,
            default=0,
            metavar="N",
            help="real-time priority 1 to 99 (SCHED_FIFO); needs permission (default: none)",
        ),
        Argument(
            "--constant",
            group=CARE,
            action="store_true",
            help="send a constant state without any physics, to measure the server alone",
        ),
    ]
