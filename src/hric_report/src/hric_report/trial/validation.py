"""Command `hric validate human`: compares joint angles and moments of trials with those of other programs."""

import argparse
import csv
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hric_bags import text
from hric_bags.files import make_folder, write_text
from hric_core.command import Argument, Command
from hric_report.html import templates
from hric_report.html.chart import Axis
from hric_report.html.table import PageTable
from hric_report.trial.command import moved, of_each, trial_arguments
from hric_report.trial.opensim_check import OpenSimDifference, differences
from hric_report.trial.page import ASSETS, WIDE

TABLE, PAGE = "validation.csv", "validation.html"
HEAD = ("joint", "unit", "frames", "RMS", "RMS without mean", "largest value")
Trial = tuple[str, list[OpenSimDifference]]
"""Name of a trial, and its differences from other programs."""


class ValidateCommand(Command):
    """Compare joint angles and moments of a person in trials with those of other programs.

    Angles are compared with those in the file (Plug-in Gait), and with OpenSim's inverse kinematics of the same body
    and markers; moments with OpenSim's inverse dynamics of the same body, motion and loads. Writes
    validation.csv and validation.html. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the trials and the options of `hric validate human`."""
        return trial_arguments()

    def run(self, arguments: argparse.Namespace) -> int:
        """Compare the trials, print the table, write it and the page, and return the exit code."""
        trials, code = of_each(arguments, _compared)
        folder = arguments.motions[0].expanduser().parent if arguments.output is None else arguments.output
        make_folder(folder)
        with (folder / TABLE).open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("trial", "program", *HEAD))
            writer.writerows((name, one.program, *_cells(one)) for name, found in trials for one in found)
        write_text(folder / PAGE, build(trials))
        blocks = [
            "\n".join([f"{name}: difference from {program}", *text.rows([list(HEAD), *map(_cells, rows)])])
            for name, found in trials
            for program, rows in _by_program(found).items()
        ]
        text.show("\n\n".join([*blocks, f"files: {(folder / TABLE).absolute()}, {PAGE}"]))
        return code


def _compared(path: Path, prefix: str | None, arguments: argparse.Namespace) -> Trial:
    """Return the differences of one person in a trial; prefix: prefix of their labels, None: no prefix."""
    result, moments = moved(path, prefix, arguments)
    with tempfile.TemporaryDirectory() as folder:
        found = differences(result, moments, Path(folder))
    return path.name + (f", {result.prefix}" if prefix and result.prefix else ""), found


def _by_program(found: Sequence[OpenSimDifference]) -> dict[str, list[OpenSimDifference]]:
    """Return the differences grouped by the name of the other program."""
    return {name: [one for one in found if one.program == name] for name in dict.fromkeys(one.program for one in found)}


def _cells(one: OpenSimDifference) -> list[str]:
    """Return the cells of a row below HEAD."""
    return [one.joint, one.unit, str(one.frames), *(f"{value:.3g}" for value in (one.rms, one.varying, one.peak))]


def build(trials: Sequence[Trial]) -> str:
    """Return the HTML page with a table of the differences and a bar for each."""
    groups = []
    for name, found in trials:
        for program, rows in _by_program(found).items():
            bars = Axis(0.0, float(np.max([one.rms for one in rows])) or 1.0, 150.0, WIDE)
            groups.append(
                (f"{name}: {program}", rows, bars, PageTable("", HEAD, [_cells(one) for one in rows], folded=True))
            )
    return (
        templates.environment(ASSETS)
        .get_template("validation.html")
        .render(
            title="Validation of joint angles and moments",
            subtitle=", ".join(name for name, _ in trials),
            verdicts=[],
            foot="A difference from another program is not an error of one of them: both are estimates.",
            groups=groups,
        )
    )
