"""Command `rosrun hric_experiments benchmark`: compare controllers over collaborations, bodies and seeds."""

import argparse
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from tqdm import tqdm

from hric_bags import files
from hric_bags.run_folder import RunFolder, iso_now, runs_root
from hric_core.errors import HricError
from hric_core.parameters import read_yaml, whole
from hric_run import provenance
from hric_sweep.benchmark import definition, results, running, scoring, text
from hric_sweep.benchmark.definition import Benchmark, Controller
from hric_sweep.carrying import carry_out
from hric_sweep.engines.engine import going_on_with
from hric_sweep.engines.make import add_options, engine_of
from hric_sweep.journal import UNFINISHED_CODE, Journal
from hric_sweep.task import code_version

FILE = "benchmark.yaml"
MEMORY = 4e9
"""Memory limit of a worker [bytes]; project default, unconfirmed."""
DIFFERS = 1
"""Exit code of a comparison with differences beyond the tolerance."""


def main(arguments: Sequence[str]) -> int:
    """Run the command and return its exit code."""
    given = _parser().parse_args(list(arguments))
    if given.seeds is not None:
        whole(minimum=1).checked(given.seeds, "--seeds")
    theirs = None if given.compare is None else results.read(given.compare)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    folder = _folder(given.resume) if given.resume else None
    benchmark, content, controllers = _what(given, folder)
    code = code_version()
    if folder is not None and (before := read_yaml(folder / FILE)["code"]) != code:
        raise HricError(
            f"{folder} was begun with code {before[:12]}, and this is {code[:12]}; valid: the same, or anew"
        )
    folder, found = _run(folder, benchmark, content, controllers, code, given)
    print(text.render(found))
    print(f"page: {folder / 'report.html'}\nresults: {folder / results.NAME}")
    if theirs is not None:
        return _compared(found, theirs)
    failed = any(cell["failures"] for one in found["collaborations"].values() for cell in one["controllers"].values())
    return UNFINISHED_CODE if failed else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments benchmark",
        description="Compare controllers over collaborations, bodies and seeds: findings, ergonomics, task and "
        "robustness side by side, in one table, one page and one results file. Needs no ROS master.",
        epilog=f"order: {scoring.RULE}  exit codes: 0; 1 --compare: not within the tolerance; 2 a mistake, and nothing "
        "was begun; 3 runs failed (they count as such in the table); 130 Ctrl-C (go on with --resume DIR)",
    )
    references = ", ".join(definition.references())
    parser.add_argument(
        "controllers", nargs="*", metavar="CONTROLLER", help=f"YAML files beside the references ({references})"
    )
    add = parser.add_argument
    add("--without-references", action="store_true", help="only the controllers given")
    add("--definition", type=Path, metavar="FILE", help="another definition than the one that comes with it")
    add("--collaborations", nargs="+", default=[], metavar="NAME", help="only these")
    add("--bodies", nargs="+", default=[], metavar="NAME", help="only these")
    add("--seeds", type=int, metavar="N", help="only the first N seeds")
    add_options(parser)
    add("--resume", metavar="DIR", help="go on with a benchmark that was ended before its end, by whatever")
    add("--compare", type=Path, metavar="FILE", help="results of another laboratory: says what differs from them")
    add("--runs", metavar="DIR", help="folder of all runs (default: $HRIC_RUNS, else runs/)")
    add("--quiet", action="store_true", help="no progress bar")
    return parser


def _folder(given: str) -> Path:
    folder = Path(given).expanduser()
    if not (folder / FILE).is_file():
        raise HricError(f"no benchmark in {folder}; valid: a folder with {FILE}")
    return folder


def _what(given: argparse.Namespace, folder: Path | None) -> tuple[Benchmark, dict[str, Any], list[Controller]]:
    """Return benchmark, content and controllers, from the arguments or from the benchmark that is resumed."""
    said = vars(given) if folder is None else read_yaml(folder / FILE)["given"]
    path = None if said["definition"] is None else Path(said["definition"])
    benchmark, content = definition.load(path)
    benchmark = benchmark.only(said["collaborations"], said["bodies"], said["seeds"])
    names = [*([] if said["without_references"] else definition.references()), *said["controllers"]]
    if not names:
        raise HricError("nothing to compare: --without-references needs the file of a controller")
    controllers = [definition.controller(name, benchmark) for name in names]
    if len({one.name for one in controllers}) < len(controllers):
        raise HricError(f"two controllers have one name: {', '.join(one.name for one in controllers)}")
    return benchmark, content, controllers


def _begin(given: argparse.Namespace, content: Mapping[str, Any], code: str) -> Path:
    """Create the run folder with benchmark.yaml and return its path."""
    folder = RunFolder.create(runs_root(given.runs), "benchmark").path
    said = {key: getattr(given, key) for key in ("without_references", "collaborations", "bodies", "seeds")}
    said["definition"] = None if given.definition is None else str(given.definition.expanduser().resolve())
    said["controllers"] = [
        str(Path(name).expanduser().resolve()) if name.endswith((".yaml", ".yml")) else name
        for name in given.controllers
    ]
    files.write_yaml(
        folder / FILE,
        {
            "started": iso_now(),
            "given": said,
            "code": code,
            "definition": dict(content),
            "revision": provenance.revision(),
            "versions": provenance.versions(),
            "platform": provenance.platform_info(),
        },
    )
    return folder


def _run(
    folder: Path | None,
    benchmark: Benchmark,
    content: Mapping[str, Any],
    controllers: Sequence[Controller],
    code: str,
    given: argparse.Namespace,
) -> tuple[Path, dict[str, Any]]:
    """Run a new benchmark, or resume one; return its folder and results."""
    from hric_sweep.benchmark import page

    todo = running.runs(benchmark, content["experiments"], controllers, code)
    engine, now = engine_of(given, MEMORY, len(todo)), True
    try:
        engine.check(todo[0].task)
        folder = folder or _begin(given, content, code)
        print(f"benchmark: {folder}", flush=True)
        with Journal(folder) as journal, closing(_bar(len(todo), given.quiet)) as bar, going_on_with(_command(folder)):
            responses = carry_out([one.task for one in todo], engine, journal, lambda _: bar.update())
        now = False
    except KeyboardInterrupt:
        going_on = "nothing was begun" if folder is None else f"go on: {_command(folder)}"
        print(f"\ninterrupted; {going_on}", file=sys.stderr)
        raise
    finally:
        engine.close(now=now)
    cells = scoring.cells(benchmark, todo, responses)
    found = results.make(benchmark, content, controllers, cells, code)
    found["runs"] = results.run_rows(todo, responses)
    files.write_json(folder / results.NAME, results.finite(found))
    page.write(folder, found)
    return folder, found


def _command(folder: Path) -> str:
    return f"rosrun hric_experiments benchmark --resume {folder}"


def _bar(total: int, quiet: bool) -> Any:
    return tqdm(total=total, unit=" runs", desc="benchmark", disable=quiet or None)


def _compared(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> int:
    differences = results.compare(ours, theirs)
    share = f"{100.0 * ours['tolerance']:g} %"
    if not differences:
        print(f"within {share} of the other results")
        return 0
    print("\n".join([f"differs from the other results by more than {share}:", *(f"  {one}" for one in differences)]))
    return DIFFERS
