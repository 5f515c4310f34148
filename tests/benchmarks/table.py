"""What the workspace costs, in one table; and whether that is more than it was.

Each case runs in several processes, one after the other, in turn with a bare step of PyBullet. Times are those of the
processor, but on the wall where several processes work together. The ratio to the bare step is the median of the
processes' medians, its spread their standard deviation: what two processes of the same code differ by.
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

from cases import CASES, REFERENCE, Case
from scipy.stats import t as student
from tqdm import tqdm
from turns import Worker, take_turns

from hric_bags.text import rows
from hric_core.errors import HricError
from hric_core.processes import run_command

RELEASED = Path(__file__).with_name("released.json")
"""The table of the last release."""
LEAST = 0.08
"""A change below this is none, however little the processes differ [1] (chosen by this project)."""
CONFIDENCE = 0.999
"""That what is called a change is one, by Student's t of the processes [1] (chosen by this project). With the same code
one line in a thousand is called otherwise."""
PREFIXES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"))


@dataclass(frozen=True)
class Row:
    """What a case cost.

    Attributes:
        seconds: of a unit, median [s].
        ratio: to a bare step of PyBullet, median of the processes [1].
        spread: standard deviation of the ratio between processes, as a share of it [1].
        processes: how many.
    """

    seconds: float
    ratio: float
    spread: float
    processes: int


def timed(name: str, processes: int, reference: Worker) -> Row:
    """Time a case in so many processes, in turn with the reference."""
    seconds, ratios = [], []
    for _ in range(processes):
        with Worker(name) as worker:
            steps, times = take_turns([reference, worker], CASES[name].rounds)
        seconds.append(statistics.median(times))
        ratios.append(statistics.median(time / step for time, step in zip(times, steps, strict=True)))
    return Row(statistics.median(seconds), statistics.median(ratios), spread(ratios), processes)


def spread(ratios: Sequence[float]) -> float:
    """Standard deviation between processes, as a share of their mean; of one alone not known, so 0."""
    return statistics.stdev(ratios) / statistics.fmean(ratios) if len(ratios) > 1 else 0.0


def beside(name: str, processes: int, tree: Path) -> list[float]:
    """Time of this code over that of another workspace, of each pair of processes that take turns [1]."""
    ratios = []
    for _ in range(processes):
        with ExitStack() as stack:
            before, now = stack.enter_context(Worker(name, tree)), stack.enter_context(Worker(name))
            times = take_turns([before, now], CASES[name].rounds)
        ratios.append(statistics.median(b / a for a, b in zip(*times, strict=True)))
    return ratios


def verdict(change: float, error: float, processes: int) -> str:
    """Whether a ratio of new to old is a change.

    Args:
        change: the ratio [1].
        error: its standard error, estimated from so many processes [1].
        processes: of one nothing is known of the error.
    """
    times = float(student.ppf(0.5 + 0.5 * CONFIDENCE, processes - 1)) if processes > 1 else 0.0
    least = max(LEAST, times * error)
    return "SLOWER" if change > 1.0 + least else "faster" if change < 1.0 / (1.0 + least) else "equal"


def processor() -> str:
    """Model of the processor, and how many there are."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return f"{len(models)} x {models[0] if models else 'unknown'}"


def told(seconds: float) -> str:
    """A time with the unit that suits it."""
    factor, unit = next((pair for pair in PREFIXES if seconds >= pair[0]), PREFIXES[-1])
    return f"{seconds / factor:.3g} {unit}"


def print_table(found: Mapping[str, Row]) -> None:
    """Of all that was timed."""
    cells = [["case", "time", "per", "beside a bare step", "+-", "what"]]
    for name, row in found.items():
        case: Case = CASES[name]
        time = told(row.seconds) + (" (wall)" if case.several else "")
        cells.append([name, time, case.unit, f"{row.ratio:.3g}", f"{100.0 * row.spread:.1f} %", case.what])
    print("\n".join(rows(cells)))


def stored(path: Path) -> dict[str, Row]:
    """A table that was saved.

    Raises:
        HricError: there is none, or it is of another processor, whose ratios are others.
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
    """Print the changes of the ratios. Returns whether nothing is slower."""
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
    """Let the code of another workspace take turns with this one. Returns whether nothing is slower."""
    cells, good = [["case", "now / before", "+-", ""]], True
    try:
        for name in tqdm(names, disable=None, leave=False):
            ratios = beside(name, processes, tree)
            result = verdict(statistics.median(ratios), spread(ratios) / math.sqrt(len(ratios)), len(ratios))
            good &= result != "SLOWER"
            cells.append([name, f"{statistics.median(ratios):.3f}", f"{100.0 * spread(ratios):.1f} %", result])
    finally:
        print("\n".join(rows(cells)))  # after Ctrl-C, too: what was timed until then
    return good


def chosen(given: Sequence[str]) -> list[str]:
    """Cases by their names, or by how these begin; all if there are none.

    Raises:
        HricError: nothing begins so.
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
    parser.add_argument("cases", nargs="*", metavar="CASE", help="names, or how they begin, such as cycle/mujoco; all")
    parser.add_argument(
        "--compare",
        nargs="?",
        const=str(RELEASED),
        metavar="WHAT",
        help="a table that was saved on such a processor (that of the last release), or the folder of another "
        "workspace that is set up: old and new then take turns",
    )
    parser.add_argument("--save", type=Path, metavar="FILE", help="keep the table")
    parser.add_argument("--processes", type=int, default=8, metavar="N", help="of each case (8)")
    return parser


def benchmark(arguments: Sequence[str]) -> int:
    """The command line; answers the exit code: 1 where something is slower."""
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
        with Worker(REFERENCE) as reference:
            for name in tqdm(names, disable=None, leave=False):
                found[name] = timed(name, processes, reference)
    finally:
        print_table(found)  # after Ctrl-C, too: what was timed until then
    return found


def main() -> int:
    """Run the command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    return run_command("benchmark", lambda: benchmark(sys.argv[1:]))


if __name__ == "__main__":
    sys.exit(main())
