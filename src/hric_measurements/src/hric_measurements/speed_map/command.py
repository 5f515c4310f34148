"""Command `speed_map`: estimate the limit speed for contacts with a person over the workspace of an arm."""

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import pandas
from tqdm import tqdm

from hric_assessment.contact.limits import Limits
from hric_assessment.findings import DISCLAIMER
from hric_bags import files
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_core.parameters import number
from hric_human.body.regions import REGION_MODELS
from hric_measurements.speed_map import grid
from hric_measurements.speed_map.blow import ArmBehaviour, simulated_arm
from hric_measurements.speed_map.measured import MapCell, MapRequest, alone, lowest, measure
from hric_run.definition import overrides

REGION = "hand, fingers"
X, Y, Z = (0.3, 0.7, 5), (-0.4, 0.4, 5), (0.2, 0.6, 3)
"""Default grid: lowest and highest coordinate in the base frame [m] and number of points, for each axis."""
CSV_FILE, PICTURE = "speed_map.csv", "speed_map.png"
HEAD = (
    "x [m]",
    "y [m]",
    "z [m]",
    "direction",
    "reflected mass [kg]",
    "limit speed [m/s]",
    "maximum arm speed [m/s]",
    "closed form [m/s]",
    "ISO estimate with M/2 + m_L [m/s]",
    "mass with locked joints [kg]",
    "closed form with locked joints [m/s]",
)
COLUMNS = ("mass", "speed", "fastest", "closed_form", "standard", "locked_mass", "locked")
"""Attributes of `MapCell` in the columns after the direction."""
Measured = Mapping[tuple[float, ...], list[MapCell]]
"""Results in all directions, by point; empty if the arm does not reach the point."""


class SpeedMapCommand(Command):
    """Estimate the limit speed of an arm over its workspace."""

    description = (
        "Estimate the limit speed over the workspace. At each point of a grid, along the six directions of the base "
        "axes, the simulated end effector hits a virtual measuring device: a spring and a mass that represent a body "
        "region (ISO/TS 15066), read at 1 kHz. The limit speed is the speed at which the peak force equals the limit "
        f"for transient contacts. {DISCLAIMER}"
    )
    epilog = f"overrides (only those of the arm have an effect):\n{overrides.help_text()}"

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("overrides", nargs="*", metavar="key:=value", help="simulator:=pybullet, friction:=..., ..."),
            Argument(
                "--region",
                choices=REGION_MODELS,
                default=REGION,
                help=f"body region that the arm hits (default: {REGION})",
            ),
            Argument("--damping", type=float, default=0.0, help="damping of the measuring device [N s/m] (default: 0)"),
            Argument(
                "--arm",
                choices=[arm.value for arm in ArmBehaviour],
                default=ArmBehaviour.DRIVEN.value,
                help="behaviour during the contact. driven: joint control continues the motion, with the reflexes of "
                "the "
                "control box (default); passive: gravity compensation only, as the closed form assumes",
            ),
            *(_range_argument(*axis) for axis in (("--x", X), ("--y", Y), ("--z", Z))),
            Argument(
                "-o",
                dest="out",
                type=Path,
                metavar="DIR",
                help=f"folder for {CSV_FILE} and {PICTURE} (default: no files are written)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Compute the map, print its summary, and write its table and picture."""
        number(minimum=0.0).checked(arguments.damping, "--damping")
        points = grid.points(arguments.x, arguments.y, arguments.z)
        request = MapRequest(arguments.region, Limits.named(), arguments.damping, ArmBehaviour(arguments.arm))
        force = request.check()
        with simulated_arm(arguments.overrides) as robot:
            progress = tqdm(
                measure(robot, request, points),
                total=len(points),
                unit=" points",
                desc="speed map",
                disable=not sys.stderr.isatty(),
                leave=False,
            )
            cells_by_point = {tuple(map(float, point)): cells for point, cells in progress}
        if not any(cells_by_point.values()):
            raise HricError(f"the arm reaches none of the {len(points)} points; valid: a grid within its workspace")
        print(report(cells_by_point, request, force))
        if arguments.out is not None:
            _write(arguments.out, cells_by_point, request, force)


def _range_argument(name: str, default: tuple[float, float, int]) -> Argument:
    values = " ".join(map(str, default))
    text = f"lowest and highest coordinate in the base frame [m], and number of points (default: {values})"
    return Argument(name, nargs=3, type=float, default=default, metavar=("LOW", "HIGH", "COUNT"), help=text)


def report(cells_by_point: Measured, request: MapRequest, force: float) -> str:
    """Return the summary of a map for the terminal; `force`: limit of the peak force [N]."""
    cells = [cell for cells_of_point in cells_by_point.values() for cell in cells_of_point]
    worst, ratios = lowest(cells), [cell.speed / cell.closed_form for cell in cells]
    unsafe, locked = (sum(getattr(cell, name) > cell.speed for cell in cells) for name in ("standard", "locked"))
    limit = request.limit
    lines = [
        f"{request.region}, {request.arm.value} arm: {force:g} N ({request.limits.table.title}), spring "
        f"{limit.stiffness:g} N/m, mass {REGION_MODELS[request.region].mass:g} kg, damping {request.damping:g} N s/m",
        f"{len(cells_by_point)} points, {sum(map(bool, cells_by_point.values()))} of them within reach; {len(cells)} "
        "directions",
        f"limit speeds {worst.speed:.3f} to {max(cell.speed for cell in cells):.3f} m/s; the lowest at "
        f"({', '.join(f'{x:.2f}' for x in worst.point)}) m along {worst.direction}, reflected mass {worst.mass:.2f} kg"
        f", with locked joints {worst.locked_mass:.2f} kg",
        f"the arm alone reaches the limit speed in {sum(map(alone, cells))} of {len(cells)} directions",
        f"ratio of the limit speed to the closed form F/sqrt(mu k): {min(ratios):.3f} to {max(ratios):.3f}",
        f"The ISO estimate M/2 + m_L is less strict than the simulated measuring device in {unsafe} of {len(cells)} "
        f"directions, the mass with locked joints in {locked} of them.",
    ]
    return "\n".join([*lines, DISCLAIMER])


def as_csv(cells_by_point: Measured) -> str:
    """Return the map as a CSV table; its first line is the disclaimer."""
    rows = [
        (*cell.point, cell.direction, *(getattr(cell, name) for name in COLUMNS))
        for cells in cells_by_point.values()
        for cell in cells
    ]
    table: str = pandas.DataFrame(rows, columns=HEAD).to_csv(index=False, float_format="%.5g")
    return f"# {DISCLAIMER}\n{table}"


def _write(folder: Path, cells_by_point: Measured, request: MapRequest, force: float) -> None:
    from hric_measurements.speed_map.picture import draw  # imported here: slow to load, and needed for the picture only

    files.make_folder(folder)
    files.write_text(folder / CSV_FILE, as_csv(cells_by_point))
    draw(folder / PICTURE, cells_by_point, f"{request.region}, {request.arm.value} arm, {force:g} N")
    print(f"table: {folder / CSV_FILE}\npicture: {folder / PICTURE}")
