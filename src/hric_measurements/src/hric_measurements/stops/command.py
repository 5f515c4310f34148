"""Command `measure_stops`: measure stopping time and distance of the emulated arm."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.separation import stopping
from hric_assessment.separation.stopping import StopRow, StopTable
from hric_bags import files
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_core.parameters import number
from hric_measurements.stops import measuring
from hric_run.definition import experiment, overrides
from hric_run.simulation import Simulation

SPEEDS = (0.05, 0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
"""Default speeds of the end effector [m/s]."""
LOADS = (0.0, 1.0, 2.0, 3.0)
"""Default loads [kg]; the payload of a Panda is 3 kg."""


class MeasureStopsCommand(Command):
    """Measure stopping time and distance of the emulated arm."""

    description = (
        "Measure stopping time and distance of the emulated arm after its user stop is pressed, for each speed of the "
        "end effector and each load: the maximum over several poses and directions. The table is a file for --stop. "
        f"Its values are {stopping.NOT_A_BRAKE}. Needs no ROS master."
    )
    epilog = f"overrides (only those of the arm have an effect):\n{overrides.help_text()}"

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("overrides", nargs="*", metavar="key:=value", help="simulator:=pybullet, friction:=..., ..."),
            Argument(
                "--speeds", nargs="+", type=float, default=SPEEDS, metavar="V", help="speeds of the end effector [m/s]"
            ),
            Argument(
                "--loads", nargs="+", type=float, default=LOADS, metavar="M", help="loads at the end effector [kg]"
            ),
            Argument("-o", dest="out", type=Path, metavar="FILE", help="file to write (default: print the table)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Measure the stops and print their table or write it to a file."""
        for name, values, minimum in (("--speeds", arguments.speeds, 1e-3), ("--loads", arguments.loads, 0.0)):
            for value in values:
                number(minimum=minimum).checked(value, name)
        definition = experiment.load(experiment.NONE, ["simulator:=mujoco", *arguments.overrides])
        with Simulation(definition) as simulation:
            robot = simulation.app.hw
            if not isinstance(robot, FrankaHWSim):
                raise HricError(
                    f"{type(robot).__name__} has no emulated control box to stop it; valid: franka_sim/FrankaHWSim"
                )
            table = measured(robot, sorted(set(arguments.speeds)), sorted(set(arguments.loads)), arguments.command)
        if arguments.out is None:
            print(stopping.as_yaml(table), end="")
            return
        files.write_text(arguments.out, stopping.as_yaml(table))
        print(
            f"table of {len(table.stops)} stops, the worst for each speed and load: {arguments.out}\n"
            f"These are {stopping.NOT_A_BRAKE}."
        )


def measured(robot: FrankaHWSim, speeds: Sequence[float], loads: Sequence[float], command: str) -> StopTable:
    """Return the table of stopping times and distances of an arm.

    Args:
        robot: simulated robot.
        speeds: speeds of the end effector, in ascending order [m/s].
        loads: loads, in ascending order [kg].
        command: command that reproduces the table.

    Raises:
        HricError: no pose reaches any of the speeds.
    """
    limits = robot.box.config.limits
    poses = measuring.poses(limits.lower, limits.upper)
    stopping_arm, rows = measuring.StoppedArm(robot), list[StopRow]()
    pairs = [(load, speed) for load in loads for speed in speeds]
    for load, speed in tqdm(pairs, unit=" speeds", desc="stops", disable=not sys.stderr.isatty(), leave=False):
        if not rows or rows[-1].load != load:
            stopping_arm.carry(load)
        row = measuring.worst(stopping_arm, poses, speed, load, limits.velocity)
        rows += [] if row is None else [row]
    if not rows:
        raise HricError(f"no pose reaches {speeds[0]:g} m/s within the joint velocity limits; valid: lower speeds")
    return StopTable(
        title=f"stops of the emulated {robot.arm_id}, {type(robot.plant).__name__}",
        kind=stopping.SIMULATION,
        source=f"user stop of the emulated control box: the worst of {len(poses)} poses and up to "
        f"{2 * (3 + measuring.ALONE)} directions; at rest below {1000.0 * measuring.STANDSTILL:g} mm/s",
        command=command,
        reaction_time=robot.plant.time_step,
        stops=tuple(rows),
    )
