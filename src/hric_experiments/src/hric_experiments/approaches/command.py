"""`rosrun hric_experiments approaches`: draws, runs, writes each outcome at once, and counts."""

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

from hric_assessment.findings import DISCLAIMER
from hric_control.errors import HricError
from hric_control.parameters import whole
from hric_experiments.approaches.draw import draw
from hric_experiments.approaches.meetings import MOVING, PUSHED, STANDING_ARM, Met
from hric_experiments.approaches.run import Outcome, Runner

COUNT, QUICK = 1000, 20
CONFIDENCE = 0.95


def parser() -> argparse.ArgumentParser:
    """Of the command line."""
    made = argparse.ArgumentParser(
        "rosrun hric_experiments approaches",
        description="Approaches of a person to a working arm, drawn by seed, in the experiment shared_workspace: "
        "contacts above limits while the arm moves, and those with a standing arm. "
        "Exit code 1 where there is one of the first.",
    )
    made.add_argument("--count", type=int, default=COUNT, help=f"how many (default: {COUNT})")
    made.add_argument("--quick", action="store_true", help=f"{QUICK} of them")
    made.add_argument("--first", type=int, default=0, help="seed of the first; the others follow (default: 0)")
    made.add_argument("--without", action="store_true", help="the supervisor watches and does not act")
    made.add_argument("--simulator", default="mujoco", help="engine (default: mujoco)")
    made.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    made.add_argument(
        "--output", type=Path, metavar="FILE", help="a line of JSON for each; what is there already is not run again"
    )
    return made


def main(arguments: Sequence[str]) -> int:
    """Run the command; returns the exit code: 1 where a moving arm met somebody above limits."""
    given = parser().parse_args(arguments)
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
    found = [done[seed] for seed in range(given.first, given.first + count)]
    print(report(found))
    return int(any(one.above(MOVING) for one in found))


def _outcomes(seeds: Sequence[int], given: argparse.Namespace) -> Iterator[Outcome]:
    """In the order of the seeds."""
    if given.jobs == 1 or len(seeds) < 2:
        yield from map(_Worker(given.simulator, not given.without), seeds)
        return
    pool = ProcessPoolExecutor(
        given.jobs, get_context("spawn"), initializer=_start, initargs=(given.simulator, not given.without)
    )
    with pool:
        yield from pool.map(_run, seeds)


class _Worker:
    """A runner that is kept."""

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
    """Outcomes of a file by seed, those with or without the supervisor; none where there is no file.

    Raises:
        HricError: a line that is none.
    """
    found: dict[int, Outcome] = {}
    for number, line in enumerate(path.read_text().splitlines() if path.is_file() else (), 1):
        try:
            values: Mapping[str, Any] = json.loads(line)
            one = Outcome(**{**values, "contacts": [Met(**met) for met in values["contacts"]]})
        except (ValueError, TypeError, KeyError) as error:
            raise HricError(f"{path}, line {number}: {error}; valid: a file that this command wrote") from None
        if one.supervised is supervised:
            found[one.seed] = one
    return found


def at_most(count: int) -> float:
    """Upper end of the one-sided interval of a probability, of 0 in `count`: 1 - (1 - confidence)^(1/count)."""
    return float(1.0 - (1.0 - CONFIDENCE) ** (1.0 / count))


def report(found: Sequence[Outcome]) -> str:
    """For the terminal."""
    count, supervised = len(found), found[0].supervised
    speeds = [one.speed for one in found]
    hit = [one for one in found if one.above(MOVING)]
    touched = [one for one in found if any(met.arm == MOVING for met in one.contacts)]
    standing = [one for one in found if any(met.arm in (STANDING_ARM, PUSHED) for met in one.contacts)]
    heavy = [one for one in standing if one.above(STANDING_ARM) or one.above(PUSHED)]
    bound = (
        f"at most {100.0 * at_most(count):.1f} % (one-sided {100.0 * CONFIDENCE:.0f} %)"
        if not hit
        else f"{100.0 * len(hit) / count:.1f} %"
    )
    lines = [
        f"{count} approaches, seeds {found[0].seed} to {found[-1].seed}, at {min(speeds):.2f} to {max(speeds):.2f} "
        f"m/s, {'with the supervisor' if supervised else 'WITHOUT the supervisor'}",
        f"contacts above limits while the arm moves faster than 10 mm/s: in {len(hit)} of {count}, {bound}",
        f"contacts with a moving arm at all: in {len(touched)}",
        f"contacts with a standing arm: in {len(standing)}; above limits, by the person's own speed: in {len(heavy)}",
        f"decisions in which the arm moved nearer than the protective distance: {sum(one.violations for one in found)}",
        f"share of the time stopped {np.mean([one.stopped for one in found]):.2f}, "
        f"slowed {np.mean([one.slowed for one in found]):.2f}",
    ]
    worst = [met for one in hit for met in one.above(MOVING)]
    if worst:
        shares = [met.share for met in worst if math.isfinite(met.share)]
        faces = sum(math.isinf(met.share) for met in worst)
        lines.append(
            f"of those above limits: up to {max(shares, default=math.nan):.1f} times the limit; head or face: {faces}"
        )
        lines.append("seeds: " + ", ".join(str(one.seed) for one in hit[:20]) + (", ..." if len(hit) > 20 else ""))
    return "\n".join([*lines, DISCLAIMER])
