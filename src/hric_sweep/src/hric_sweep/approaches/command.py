"""Command `approaches`."""

import argparse
import json
import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from hric_analysis.contacts import CONTACT_AREA
from hric_assessment.findings import DISCLAIMER
from hric_assessment.findings import Outcome as Result
from hric_assessment.verdict.conclusions import ORDER
from hric_assessment.verdict.result import EXIT_CODES
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_core.parameters import whole
from hric_sweep.approaches.draw import draw
from hric_sweep.approaches.meetings import MOVING, PUSHED, STANDING_ARM, ContactEvent
from hric_sweep.approaches.run import Outcome, Runner
from hric_sweep.statistics.intervals import clopper_pearson_upper

COUNT, QUICK = 1000, 20
"""Number of approaches, by default and with --quick."""
CONFIDENCE = 0.95
"""Level of the one-sided bound [1]."""


class ApproachesCommand(Command):
    """Simulate approaches of a person to a working arm, drawn by seed, in the experiment shared_workspace: contacts
    above limits while the arm moves, and those with a standing arm."""

    epilog = (
        "exit codes: 0 no contact with the moving arm was above limits; 3 one was; 4 one is not assessable, or a "
        "run failed."
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument("--count", type=int, default=COUNT, help=f"how many (default: {COUNT})"),
            Argument("--quick", action="store_true", help=f"{QUICK} of them"),
            Argument("--first", type=int, default=0, help="seed of the first; the others follow (default: 0)"),
            Argument("--without", action="store_true", help="the supervisor watches and does not act"),
            Argument("--simulator", default="mujoco", help="engine (default: mujoco)"),
            Argument("--jobs", type=int, default=2, help="processes (default: 2)"),
            Argument(
                "--output",
                type=Path,
                metavar="FILE",
                help="a line of JSON for each; what is there already is not run again",
            ),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Run the approaches that are missing, write each outcome at once, and count."""
        for name in ("count", "first", "jobs"):
            whole(minimum=0 if name == "first" else 1).checked(getattr(given, name), f"--{name}")
        count = QUICK if given.quick else given.count
        done = {} if given.output is None else read(given.output, not given.without)
        missing = [seed for seed in range(given.first, given.first + count) if seed not in done]
        for outcome in _outcomes(missing, given):
            done[outcome.seed] = outcome
            if given.output is not None:
                with given.output.open("a") as file:
                    file.write(json.dumps(asdict(outcome)) + "\n")
        outcomes = [done[seed] for seed in range(given.first, given.first + count)]
        print(report(outcomes))
        results = {contact.outcome for outcome in outcomes for contact in outcome.met(MOVING)}
        if any(outcome.failure for outcome in outcomes):
            results.add(Result.NOT_ASSESSABLE)
        return next((EXIT_CODES[result] for result in ORDER if result in results), 0)


def _outcomes(seeds: Sequence[int], options: argparse.Namespace) -> Iterator[Outcome]:
    """Run approaches, in the order of the seeds."""
    if options.jobs == 1 or len(seeds) < 2:
        yield from map(_Worker(options.simulator, not options.without), seeds)
        return
    settings = options.simulator, not options.without
    pool = ProcessPoolExecutor(options.jobs, get_context("spawn"), initializer=_start, initargs=settings)
    with pool:
        yield from pool.map(_run, seeds)


class _Worker:
    """Runner of one process, reused for each approach."""

    def __init__(self, simulator: str, supervised: bool) -> None:
        logging.getLogger("hric").setLevel(logging.CRITICAL)  # reflexes are counted
        self._runner = Runner(simulator, supervised)

    def __call__(self, seed: int) -> Outcome:
        return self._runner.run(draw(seed))


_workers: list[_Worker] = []


def _start(simulator: str, supervised: bool) -> None:
    _workers.append(_Worker(simulator, supervised))


def _run(seed: int) -> Outcome:
    return _workers[0](seed)


def read(path: Path, supervised: bool) -> dict[int, Outcome]:
    """Read the outcomes of a file by seed, those with or without the supervisor; none if there is no file.

    Raises:
        HricError: a line of another kind, or of an earlier version.
    """
    outcomes: dict[int, Outcome] = {}
    for number, line in enumerate(path.read_text().splitlines() if path.is_file() else (), 1):
        try:
            values: Mapping[str, Any] = json.loads(line)
            contacts = [ContactEvent(**{**one, "outcome": Result(one["outcome"])}) for one in values["contacts"]]
            outcome = Outcome(**{**values, "contacts": contacts})
        except (ValueError, TypeError, KeyError) as error:
            raise HricError(f"{path}, line {number}: {error}; valid: a file that this version wrote") from None
        if outcome.supervised is supervised:
            outcomes[outcome.seed] = outcome
    return outcomes


def report(outcomes: Sequence[Outcome]) -> str:
    """Return the text for the terminal."""
    count, supervised = len(outcomes), outcomes[0].supervised
    speeds = [one.speed for one in outcomes]
    moving = [one.met(MOVING) for one in outcomes]
    standing = [one.met(STANDING_ARM, PUSHED) for one in outcomes]
    above = _runs(moving, Result.ABOVE)
    failed = [outcome for outcome in outcomes if outcome.failure]
    unproven = sum(any(one.above or one.not_assessable for one in contacts) for contacts in moving) + len(failed)
    bound = 100.0 * clopper_pearson_upper(unproven, count, CONFIDENCE)
    lines = [
        f"{count} approaches, seeds {outcomes[0].seed} to {outcomes[-1].seed}, at {min(speeds):.2f} to "
        f"{max(speeds):.2f} m/s, {'with the supervisor' if supervised else 'WITHOUT the supervisor'}",
        f"contacts above limits while the arm moves faster than 10 mm/s: in {above} of {count}, at most {bound:.1f} % "
        f"(one-sided {100.0 * CONFIDENCE:.0f} %)",
        f"contacts with a moving arm: {_counts(moving)}",
        f"contacts with a standing arm, by the person's own speed: {_counts(standing)}",
        f"area of a contact: {CONTACT_AREA:g} m^2 (project default); not assessable counts as above in the bound",
        f"decisions in which the arm moved nearer than the protective distance: {sum(o.violations for o in outcomes)}",
        f"share of the time stopped {np.mean([outcome.stopped for outcome in outcomes if not outcome.failure]):.2f}, "
        f"slowed {np.mean([outcome.slowed for outcome in outcomes if not outcome.failure]):.2f}",
    ]
    hit = [str(one.seed) for one in outcomes if any(contact.above for contact in one.met(MOVING))]
    if hit:
        shares = [one.share for contacts in moving for one in contacts if one.above]
        largest = max(filter(math.isfinite, shares), default=math.inf)
        lines.append(f"of those above limits: up to {largest:.1f} times the limit")
        lines.append("seeds: " + ", ".join(hit[:20]) + (", ..." if len(hit) > 20 else ""))
    if failed:
        lines.append(f"runs that failed, of whose contacts nothing is known (above in the bound): {len(failed)}")
        lines += [f"  seed {outcome.seed}: {outcome.failure}" for outcome in failed]
    return "\n".join([*lines, DISCLAIMER])


def _runs(contacts: Sequence[Sequence[ContactEvent]], outcome: Result) -> int:
    """Return the number of runs with an outcome; contacts: of each run."""
    return sum(any(one.outcome == outcome for one in own) for own in contacts)


def _counts(contacts: Sequence[Sequence[ContactEvent]]) -> str:
    """Return the number of runs with each outcome, as text; contacts: of each run."""
    counts = ", ".join(f"{outcome} in {_runs(contacts, outcome)}" for outcome in ORDER)
    return f"in {sum(map(bool, contacts))} of {len(contacts)} runs ({counts})"
