"""Arguments of the command `control_box`."""

import argparse
from typing import Any

from franka_sim.fci.console import HELP
from franka_sim.fci.robots import ROBOTS
from franka_sim.realism import IDEAL
from franka_sim.settings import Q_START
from hric_core import yaml_text
from hric_core.errors import ParameterError

DEFAULT_PLANT = "pybullet_ros_control/PyBulletPlant"
MAX_LOST_PACKETS = 20
"""Number of consecutive lost commands that ends a motion of the arm."""


def yaml_value(text: str) -> Any:
    """Return a word of the command line, parsed as YAML."""
    try:
        return yaml_text.parse(text, repr(text))
    except ParameterError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command's arguments."""
    made = argparse.ArgumentParser(
        prog="rosrun franka_sim control_box",
        description="An emulated Panda or FR3: arm, control box and hand, to which an unmodified libfranka connects. "
        "Needs no ROS master.",
        epilog="With --console the standard input takes:\n" + HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_robot(made)
    _add_physics(made)
    _add_network(made)
    _add_care(made)
    return made


def _add_robot(made: argparse.ArgumentParser) -> None:
    add = made.add_argument
    add(
        "--ip",
        default="127.0.0.1",
        help="address to listen on (default: %(default)s, this machine only; several robots: 127.0.0.2, "
        "127.0.0.3, ...)",
    )
    add(
        "--robot",
        choices=tuple(ROBOTS),
        default="panda",
        help="panda: protocol 5, libfranka 0.9; fr3: protocol 10, libfranka 0.18 or later (default: %(default)s)",
    )
    add(
        "--clock",
        choices=("lock_step", "wall"),
        default="lock_step",
        help="lock_step: robot time waits for the client; wall: it does not (default: %(default)s)",
    )
    add(
        "--real-time-factor",
        type=float,
        default=1.0,
        metavar="X",
        help="robot time per wall time; 0, lock_step only: as fast as the client (default: %(default)s)",
    )
    add("--no-hand", action="store_true", help="an arm without the hand")
    add("--q-start", type=float, nargs=7, default=list(Q_START), metavar="RAD", help="pose at the start [rad]")


def _add_physics(made: argparse.ArgumentParser) -> None:
    add = made.add_argument_group("physics").add_argument
    add("--plant", default=DEFAULT_PLANT, metavar="PACKAGE/CLASS", help="physics plugin (default: %(default)s)")
    add(
        "--rotor-inertia",
        type=float,
        default=0.1,
        metavar="KGM2",
        help="of each joint, in the plant and as the box knows it (default: %(default)s)",
    )
    add(
        "--friction",
        choices=("none", "identified"),
        default=None,
        help="joint friction of the plant, which the box compensates as far as --realism says (default: as "
        "--realism says, else none)",
    )
    add(
        "--realism",
        type=yaml_value,
        default=IDEAL,
        metavar="PRESET",
        help="how far the arm is from what its box believes: ideal, measured, or as '{preset: measured, dq_noise: "
        "0}' (default: %(default)s)",
    )
    add("--no-collision", action="store_true", help="no contact of the arm with itself or the world")
    add(
        "--world",
        default="",
        metavar="FILE",
        help="objects around the arm, path or package://PACKAGE/FILE (plants that know worlds)",
    )
    add("--gui", action="store_true", help="show the plant")


def _add_network(made: argparse.ArgumentParser) -> None:
    add = made.add_argument_group("faults of the network, in each direction").add_argument
    add("--latency", type=float, default=0.0, metavar="S", help="[s]")
    add("--jitter", type=float, default=0.0, metavar="S", help="added to it, from 0 to this [s]")
    add("--loss", type=float, default=0.0, metavar="SHARE", help="share of datagrams lost, 0 to 1")
    add("--seed", type=int, default=0, metavar="N", help="of the faults, and of the noise of the sensors")


def _add_care(made: argparse.ArgumentParser) -> None:
    add = made.add_argument_group("protection, operation, measurement").add_argument
    add("--no-reflexes", action="store_true", help="the arm does not protect itself")
    add(
        "--max-lost-packets",
        type=int,
        default=MAX_LOST_PACKETS,
        metavar="N",
        help="commands lost in a row that end a motion; 0: any number (default: %(default)s)",
    )
    add("--console", action="store_true", help="take commands from the standard input")
    add(
        "--priority",
        type=int,
        default=0,
        metavar="N",
        help="real-time priority 1 to 99 (SCHED_FIFO); needs the right to it (default: none)",
    )
    add("--constant", action="store_true", help="no arm: a constant state, to measure the server alone")
