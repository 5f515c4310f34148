"""Arguments of the command `control_box`."""

import argparse
from typing import Any

from franka_sim.fci.robots import MAX_LOST_PACKETS, ROBOTS
from franka_sim.realism import IDEAL
from franka_sim.settings import Q_START
from hric_core import yaml_text
from hric_core.command import Argument
from hric_core.errors import ParameterError

DEFAULT_PLANT = "pybullet_ros_control/PyBulletPlant"
PHYSICS = "physics"
NETWORK = "faults of the network, in each direction"
CARE = "protection, operation, measurement"
"""Groups of the arguments in --help."""


def yaml_value(text: str) -> Any:
    """Return a word of the command line, parsed as YAML."""
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
            help="lock_step: robot time waits for the client; wall: it does not (default: %(default)s)",
        ),
        Argument(
            "--real-time-factor",
            type=float,
            default=1.0,
            metavar="X",
            help="robot time per wall time; 0, lock_step only: as fast as the client (default: %(default)s)",
        ),
        Argument("--no-hand", action="store_true", help="an arm without the hand"),
        Argument(
            "--q-start", type=float, nargs=7, default=list(Q_START), metavar="RAD", help="pose at the start [rad]"
        ),
    ]


def physics_arguments() -> list[Argument]:
    """Return the arguments of the plant."""
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
            default=0.1,
            metavar="KGM2",
            help="rotor inertia of each joint, in the plant and in the control box (default: %(default)s)",
        ),
        Argument(
            "--friction",
            group=PHYSICS,
            choices=("none", "identified"),
            help="joint friction of the plant, which the box compensates as far as --realism says (default: as "
            "--realism says, else none)",
        ),
        Argument(
            "--realism",
            group=PHYSICS,
            type=yaml_value,
            default=IDEAL,
            metavar="PRESET",
            help="difference of the arm from its model in the box: ideal, measured, or {preset: measured, dq_noise: 0}",
        ),
        Argument(
            "--no-collision", group=PHYSICS, action="store_true", help="no contact of the arm with itself or the world"
        ),
        Argument(
            "--world",
            group=PHYSICS,
            default="",
            metavar="FILE",
            help="objects around the arm, path or package://PACKAGE/FILE (plants that know worlds)",
        ),
        Argument("--gui", group=PHYSICS, action="store_true", help="show the plant"),
    ]


def network_arguments() -> list[Argument]:
    """Return the arguments of the network."""
    return [
        Argument("--latency", group=NETWORK, type=float, default=0.0, metavar="S", help="[s]"),
        Argument(
            "--jitter", group=NETWORK, type=float, default=0.0, metavar="S", help="added to it, from 0 to this [s]"
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
            help="of the faults, and of the noise of the sensors",
        ),
    ]


def care_arguments() -> list[Argument]:
    """Return the arguments of the protection and operation of the robot."""
    return [
        Argument("--no-reflexes", group=CARE, action="store_true", help="the arm does not protect itself"),
        Argument(
            "--max-lost-packets",
            group=CARE,
            type=int,
            default=MAX_LOST_PACKETS,
            metavar="N",
            help="commands lost in a row that end a motion; 0: any number (default: %(default)s)",
        ),
        Argument("--console", group=CARE, action="store_true", help="take commands from the standard input"),
        Argument(
            "--priority",
            group=CARE,
            type=int,
            default=0,
            metavar="N",
            help="real-time priority 1 to 99 (SCHED_FIFO); needs permission (default: none)",
        ),
        Argument(
            "--constant", group=CARE, action="store_true", help="no arm: a constant state, to measure the server alone"
        ),
    ]
