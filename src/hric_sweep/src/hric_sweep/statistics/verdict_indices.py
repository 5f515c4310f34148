"""Command `hric assess sobol`: Sobol indices of the unconfirmed parameters of a verdict."""

import argparse

import numpy as np

from hric_assessment.verdict import AssessmentChoices, opened
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE
from hric_assessment.verdict.sensitivity import Sensitivity, sensitivity_of
from hric_bags.arguments import run_arguments
from hric_bags.text import rows
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.parameters import as_number
from hric_sweep.samplers.designs import Saltelli
from hric_sweep.space import Space
from hric_sweep.statistics.sensitivity import FEWEST, indices
from hric_sweep.variables import LogUniform, Variable

SEED = 0
"""Seed of design and bootstrap, fixed so that the command always gives the same indices for the same recording."""


class AssessSobolCommand(Command):
    """Show which unconfirmed parameters change the verdict on a run most: Sobol indices over their ranges.

    All parameters vary together, independently, log-uniformly within their ranges. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the run and the options of `hric assess sobol`."""
        return [
            *run_arguments("a bag with a person", "RUN|BAG"),
            Argument("--rows", type=int, default=64, help="rows of Saltelli's design, a power of two (default: 64)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the indices of each question. Raises HricError if no question compares a value with a limit."""
        count = arguments.rows
        if count < FEWEST or count & (count - 1):
            raise HricError(f"--rows is {count}; valid: a power of two, {FEWEST} or more")
        sensitivity = sensitivity_of(opened(arguments.run, arguments.runs), AssessmentChoices())
        tables = [text for question in (CONTACT, DISTANCE) if (text := _table(sensitivity, question, count))]
        if not tables:
            raise HricError(f"{arguments.run} has no contact and no distance that can be compared with a limit")
        print("\n\n".join(tables))


def _table(sensitivity: Sensitivity, question: str, count: int) -> str:
    """Return the text table of one question; "": no value can be compared with a limit.

    Args:
        sensitivity: calculation of the verdict with varied parameters.
        question: question of the verdict.
        count: number of rows of Saltelli's design.
    """
    numbers = sensitivity.numbers(question)
    if not numbers or sensitivity.level(question, {}) is None:
        return ""
    if question == DISTANCE and sensitivity.touching:
        return f"{question}: arm and person touch, so the distance is no share of a limit"
    ranges = {name: LogUniform(low=number.low, high=number.high) for name, number in numbers.items()}
    space = Space({name: Variable(paths=(name,), distribution=ranges[name]) for name in numbers})
    sampler = Saltelli().sampler(space, count * (len(numbers) + 2), SEED)
    points = np.array([point.u for point in sampler.ask()])
    cases = [{name: as_number(value) for name, value in case.items()} for case in space.values(points)]
    shares = [sensitivity.level(question, factors) for factors in cases]
    output: FloatArray = np.array([np.nan if share is None else 100.0 * share for share in shares])
    if np.nanmin(output) == np.nanmax(output):
        return f"{question}: no unconfirmed number moves the share of the limit, {output[0]:.3g} %"
    low, middle, high = np.nanpercentile(output, [2.5, 50.0, 97.5])
    found = indices(space, output, SEED)
    cells = [["number", "first-order", "total", "95 % interval of total"]]
    for name, index in sorted(found.items(), key=lambda item: -item[1].total):
        interval = f"{index.total_interval[0]:.2f} to {index.total_interval[1]:.2f}"
        cells.append([numbers[name].about, f"{index.first:.2f}", f"{index.total:.2f}", interval])
    head = f"{question}: {low:.3g} to {high:.3g} % of the limit in 95 % of {len(output)} cases, median {middle:.3g} %"
    return "\n".join([head, *rows(cells)])
