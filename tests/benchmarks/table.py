"""Program of scripts/benchmark: processor time of the workspace in one table, and comparison with an earlier one.

Each case runs in several processes, one after the other, alternating with a bare step of PyBullet. Processor time is
measured, or wall time if several processes work together. The ratio to the bare step is the median of the medians of
all processes; its spread is their standard deviation, which is the difference between processes of the same code.
"""

import argparse
import json
import math
import os
import statistics
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path

from cases import CASES, Case
from scipy.stats import t as student
from tqdm import tqdm
from turns import Worker, take_turns

from hric_bags.text import rows
from hric_core.errors import HricError
from hric_core.processes import run_command

RELEASED = Path(__file__).with_name("released.json")
"""File with the table of the last release."""
LEAST = 0.08
"""Smallest change of a ratio that is reported, even if processes differ by less [1] (chosen by this project)."""
CONFIDENCE = 0.999
"""Confidence level of a reported change, by Student's t over the processes [1] (chosen by this project).

For unchanged code, one line in a thousand is reported as a change.
"""
PREFIXES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"))


@dataclass(frozen=True)
class Row:
    """Result of a case.

    Attributes:
        seconds: median time of a unit [s].
        ratio: ratio to a bare step of PyBullet, median of the processes [1].
        spread: standard deviation of the ratio between processes, relative to the ratio [1].
        processes: number of processes.
    """

    seconds: float
    ratio: float
    spread: float
    processes: int


def timed(name: str, processes: int, reference: Worker) -> Row:
    """Measure a case in a number of processes, alternating with the reference."""
    seconds, ratios = [], []
    for _ in range(processes):
        with Worker(name) as worker:
            steps, times = take_turns([reference, worker], CASES[name].rounds)
        seconds.append(statistics.median(times))
        ratios.append(statistics.median(time / step for time, step in zip(times, steps, strict=True)))
    return Row(statistics.median(seconds), statistics.median(ratios), spread(ratios), processes)


def spread(ratios: Sequence[float]) -> float:
    """Return the standard deviation of the processes relative to their mean; 0 for a single process."""
    return statistics.stdev(ratios) / statistics.fmean(ratios) if len(ratios) > 1 else 0.0


def beside(name: str, processes: int, tree: Path) -> list[float]:
    """Return the ratios of the time of this code to that of another workspace, for alternating processes [1]."""
    ratios = []
    for _ in range(processes):
        with ExitStack() as stack:
            before, now = stack.enter_context(Worker(name, tree)), stack.enter_context(Worker(name))
            times = take_turns([before, now], CASES[name].rounds)
        ratios.append(statistics.median(b / a for a, b in zip(*times, strict=True)))
    return ratios


def verdict(change: float, error: float, processes: int) -> str:
    """Return the text for a ratio of new to old: slower, faster, or no change.

    Args:
        change: the ratio [1].
        error: standard error of the ratio, estimated from the processes [1].
        processes: number of processes; the error of a single one is unknown.
    """
    times = float(student.ppf(0.5 + 0.5 * CONFIDENCE, processes - 1)) if processes > 1 else 0.0
    least = max(LEAST, times * error)
    return "SLOWER" if change > 1.0 + least else "faster" if change < 1.0 / (1.0 + least) else "equal"


def processor() -> str:
    """Return model and number of the processors."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{len(models)} x {models[0] if models else 'unknown'}"


def told(seconds: float) -> str:
    """Return a time with a suitable unit."""
    factor, unit = next((pair for pair in PREFIXES if seconds >= pair[0]), PREFIXES[-1])
    return f"{seconds / factor:.3g} {unit}"


def print_table(found: Mapping[str, Row]) -> None:
    """Print the table of all results."""
    cells = [["case", "time", "per", "beside a bare step", "+-", "what"]]
    for name, row in found.items():
        case: Case = CASES[name]
        time = told(row.seconds) + (" (wall)" if case.several else "")
        cells.append([name, time, case.unit, f"{row.ratio:.3g}", f"{100.0 * row.spread:.1f} %", case.what])
    print("\n".join(rows(cells)))


def stored(path: Path) -> dict[str, Row]:
    """Return a saved table.

    Raises:
        HricError: the file does not exist, or is from another processor model, whose ratios cannot be compared.
    """
    try:
        content = json.loads(path.read_text())
        found = {name: Row(**row) for name, row in content["cases"].items()}
        where = content["processor"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise HricError(
            f"{path} is no table of scripts/benchmark --save ({error}); valid: such a file, or the folder of another "
            "workspace that is set up"
        ) from error
    if where != processor():
        raise HricError(
            f"{path} was made on {where}, this is {processor()}: ratios differ between processors; valid: the folder "
            "of a workspace with the old code, which takes turns with this one"
        )
    return found


def compare_stored(found: Mapping[str, Row], before: Mapping[str, Row]) -> bool:
    """Print the changes of the ratios; return True if no case is slower."""
    cells, good = [["case", "before", "now", "change", ""]], True
    for name, row in found.items():
        if name not in before:
            cells.append([name, "-", f"{row.ratio:.3g}", "-", "new"])
            continue
        old = before[name]
        error = math.hypot(row.spread / math.sqrt(row.processes), old.spread / math.sqrt(old.processes))
        result = verdict(row.ratio / old.ratio, error, min(row.processes, old.processes))
        good &= result != "SLOWER"
        cells.append([name, f"{old.ratio:.3g}", f"{row.ratio:.3g}", f"{row.ratio / old.ratio:.3f}", result])
    print("\n".join(rows(cells)))
    return good


def compare_tree(names: Sequence[str], processes: int, tree: Path) -> bool:
    """Alternate between this code and that of another workspace; print changes; return True if no case is slower."""
    cells, good = [["case", "now / before", "+-", ""]], True
    try:
        for name in tqdm(names, disable=None, leave=False):
            ratios = beside(name, processes, tree)
            result = verdict(statistics.median(ratios), spread(ratios) / math.sqrt(len(ratios)), len(ratios))
            good &= result != "SLOWER"
            cells.append([name, f"{statistics.median(ratios):.3f}", f"{100.0 * spread(ratios):.1f} %", result])
    finally:
        print("\n".join(rows(cells)))  # also after Ctrl-C: print the results so far
    return good


def chosen(given: Sequence[str]) -> list[str]:
    """Return the cases whose names begin with the given words; all cases without words.

    Raises:
        HricError: no case begins with a word.
    """
    if not given:
        return list(CASES)
    found = []
    for word in given:
        names = [name for name in CASES if name == word or name.startswith(f"{word.rstrip('/')}/")]
        if not names:
            raise HricError(f"no case {word!r}; valid: {', '.join(CASES)}, or how several begin, such as cycle/mujoco")
        found += names
    return list(dict.fromkeys(found))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "scripts/benchmark", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "cases", nargs="*", metavar="CASE", help="start of the names of the cases, such as cycle/mujoco; default: all"
    )
    parser.add_argument(
        "--compare",
        nargs="?",
        const=str(RELEASED),
        metavar="WHAT",
        help="a table that was saved on such a processor (that of the last release), or the folder of another "
        "workspace that is set up: old and new then take turns",
    )
    parser.add_argument("--save", type=Path, metavar="FILE", help="also save the table to a file")
    parser.add_argument("--processes", type=int, default=8, metavar="N", help="processes per case (default: 8)")
    return parser


def benchmark(arguments: Sequence[str]) -> int:
    """Run the command; return its exit code, 1 if a case is slower."""
    given = _parser().parse_args(list(arguments))
    names = chosen(given.cases)
    if given.processes < 1:
        raise HricError(f"--processes is {given.processes}; valid: 1 or more")
    if given.save is not None and not given.save.absolute().parent.is_dir():
        raise HricError(f"--save {given.save}: there is no folder {given.save.absolute().parent}")
    tree = None if given.compare is None or Path(given.compare).is_file() else Path(given.compare).resolve()
    if tree is not None and (tree / "tests" / "benchmarks" / "worker.py").is_file():
        if given.save is not None:
            raise HricError("--save keeps a table, and --compare with a workspace makes none; valid: one of them")
        return 0 if compare_tree(names, given.processes, tree) else 1
    before = None if given.compare is None else stored(Path(given.compare))
    found = _table(names, given.processes)
    if given.save is not None:
        rows_of = {name: asdict(row) for name, row in found.items()}
        given.save.write_text(json.dumps({"processor": processor(), "cases": rows_of}, indent=1) + "\n")
    return 0 if before is None or compare_stored(found, before) else 1


def _table(names: Sequence[str], processes: int) -> dict[str, Row]:
    found: dict[str, Row] = {}
    try:
        with ExitStack() as stack:
            kinds = dict.fromkeys(CASES[name].reference for name in names)
            references = {kind: stack.enter_context(Worker(kind)) for kind in kinds}
            for name in tqdm(names, disable=None, leave=False):
                found[name] = timed(name, processes, references[CASES[name].reference])
    finally:
        print_table(found)  # also after Ctrl-C: print the results so far
    return found


def main() -> int:
    """Run the command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return run_command("benchmark", lambda: benchmark(sys.argv[1:]))


if __name__ == "__main__":
    sys.exit(main())
