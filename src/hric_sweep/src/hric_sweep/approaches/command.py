"""Command `approaches`: run the sweep of that name and print how many contacts exceeded their limits."""

import argparse
import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hric_analysis.contacts import CONTACT_AREA
from hric_assessment.findings import DISCLAIMER, Outcome
from hric_assessment.verdict.conclusions import ORDER
from hric_assessment.verdict.result import EXIT_CODES
from hric_core.command import Argument, Command
from hric_core.parameters import read_yaml, whole
from hric_sweep import definition
from hric_sweep.approaches.draw import draw
from hric_sweep.definition import ROW
from hric_sweep.engines.pebble_engine import InProcessEngine, PebbleEngine
from hric_sweep.execution import execute
from hric_sweep.journal import Journal
from hric_sweep.records import RunResponse
from hric_sweep.statistics.intervals import clopper_pearson
from hric_sweep.task import code_version, prepare

COUNT, QUICK = 1000, 20
"""Number of approaches: default, and with --quick."""
CONFIDENCE = 0.95
"""Confidence level of the upper bound on the share of approaches with a contact above limits [1]."""
MOVING, STANDING = "", "standing_"
"""Prefixes of the names of sweep outputs that count contacts: with a moving arm, and with a standing arm."""


class ApproachesCommand(Command):
    """Simulate random approaches of a person to a working arm and count the contacts above limits.

    Each seed gives one approach in the experiment shared_workspace. Contacts with a moving and with a standing arm are
    counted separately. The runs are those of `sweep approaches`.
    """

    epilog = (
        "exit codes: 0 no contact with the moving arm was above limits; 3 at least one was; 4 at least one could not "
        "be "
        "assessed, or a run failed."
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("--count", type=int, default=COUNT, help=f"number of approaches (default: {COUNT})"),
            Argument("--quick", action="store_true", help=f"simulate only {QUICK} approaches"),
            Argument(
                "--first",
                type=int,
                default=0,
                help="seed of the first approach; the others have the seeds after it (default: 0)",
            ),
            Argument(
                "--without",
                action="store_true",
                help="the supervisor only observes; it neither slows nor stops the arm",
            ),
            Argument("--simulator", default="mujoco", help="physics engine (default: mujoco)"),
            Argument("--jobs", type=int, default=2, help="number of processes (default: 2)"),
            Argument(
                "--output",
                type=Path,
                metavar="FILE",
                help="journal with one line of JSON per approach; approaches that it contains are not run again",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Simulate the approaches and count their contacts."""
        for name in ("count", "first", "jobs"):
            whole(minimum=0 if name == "first" else 1).checked(getattr(arguments, name), f"--{name}")
        responses = simulate(arguments)
        print(report(responses, arguments.first, supervised=not arguments.without))
        return exit_code(responses)


def simulate(options: argparse.Namespace) -> list[RunResponse]:
    """Run the approaches chosen on the command line; return their results in the order of the seeds."""
    content, count = read_yaml(definition.find("approaches")), QUICK if options.quick else options.count
    content["changes"] = [f"simulator:={options.simulator}", f"supervisor.active:={not options.without}".lower()]
    content["sweep"] |= {"runs": count, "seed": options.first}
    plan, code = definition.plan("approaches", content), code_version()
    tasks = [plan.task(index, {ROW: name}, code) for index, name in enumerate(plan.section.rows)]
    prepare()  # reflexes are counted, not logged
    jobs = min(options.jobs, count)
    engine = InProcessEngine() if jobs == 1 else PebbleEngine(jobs, 1e9 * plan.section.memory)
    with contextlib.ExitStack() as stack:
        stack.callback(engine.close, now=True)
        journal = None if options.output is None else stack.enter_context(Journal(options.output))
        return execute(tasks, engine, journal)


def exit_code(responses: Sequence[RunResponse]) -> int:
    """Return the exit code for the worst contact with a moving arm; failed runs count as not assessable."""
    outcomes = {outcome for outcome in ORDER if _runs(responses, MOVING, outcome)}
    if any(response.failure for response in responses):
        outcomes.add(Outcome.NOT_ASSESSABLE)
    return next((EXIT_CODES[outcome] for outcome in ORDER if outcome in outcomes), 0)


def report(responses: Sequence[RunResponse], first: int, *, supervised: bool) -> str:
    """Return the summary of all approaches for the terminal.

    Args:
        responses: results of the approaches, in the order of their seeds.
        first: seed of the first approach.
        supervised: True if the supervisor could slow and stop the arm.
    """
    count, completed = len(responses), [response for response in responses if not response.failure]
    speeds = [draw(first + index).speed for index in range(count)]
    counted = Outcome.ABOVE, Outcome.NOT_ASSESSABLE
    unproven = _runs(responses, MOVING, *counted) + count - len(completed)
    bound = 100.0 * clopper_pearson(unproven, count, CONFIDENCE, "less").high
    stopped, slowed = (np.mean([run.outputs[name] or 0.0 for run in completed]) for name in ("stopped", "slowed"))
    lines = [
        f"{count} approaches, seeds {first} to {first + count - 1}, at {min(speeds):.2f} to {max(speeds):.2f} m/s, "
        f"{'with the supervisor' if supervised else 'WITHOUT the supervisor'}",
        f"contacts above limits while the arm moves faster than 10 mm/s: in {_runs(responses, MOVING, Outcome.ABOVE)} "
        f"of {count}, at most {bound:.1f} % (one-sided {100.0 * CONFIDENCE:.0f} %)",
        f"contacts with a moving arm: {_counts(responses, MOVING)}",
        f"contacts with a standing arm, by the person's own motion: {_counts(responses, STANDING)}",
        f"assumed contact area: {CONTACT_AREA:g} m^2 (project default); the bound counts contacts that are not "
        "assessable "
        f"as above limits",
        f"decisions of the supervisor while the arm moved nearer to the person than the protective distance: "
        f"{sum(run.outputs['violations'] or 0.0 for run in completed):.0f}",
        f"share of the time stopped {stopped:.2f}, slowed {slowed:.2f}",
    ]
    exceeding = [str(first + run.index) for run in completed if run.outputs["above"]]
    if exceeding:
        largest = max(run.outputs["known_share"] or 0.0 for run in completed) or np.inf
        lines += [
            f"largest contact above limits: {largest:.1f} times the limit",
            f"seeds with a contact above limits: {', '.join(exceeding[:20])}{', ...' * (len(exceeding) > 20)}",
        ]
    if len(completed) < count:
        lines.append(f"failed runs, contacts unknown (counted as above limits in the bound): {count - len(completed)}")
        lines += [f"  seed {first + run.index}: {run.failure}" for run in responses if run.failure]
    return "\n".join([*lines, DISCLAIMER])


def _runs(responses: Sequence[RunResponse], arm: str, *outcomes: Outcome) -> int:
    """Return the number of runs with a contact that has one of the outcomes; `arm`: MOVING or STANDING."""
    names = [f"{arm}{outcome.name.lower()}" for outcome in outcomes]
    return sum(any(response.outputs[name] for name in names) for response in responses)


def _counts(responses: Sequence[RunResponse], arm: str) -> str:
    """Return, as text, the number of runs with a contact, in total and for each outcome; `arm`: MOVING or STANDING."""
    counts = ", ".join(f"{outcome} in {_runs(responses, arm, outcome)}" for outcome in ORDER)
    return f"in {_runs(responses, arm, *ORDER)} of {len(responses)} runs ({counts})"
