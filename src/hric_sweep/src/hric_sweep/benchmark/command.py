"""Command `benchmark`: controllers compared over collaborations, bodies and seeds."""

import argparse
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from tqdm import tqdm

from hric_bags import files
from hric_bags.run_folder import RunFolder, iso_now
from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD, HricError
from hric_core.parameters import read_yaml, whole
from hric_run import provenance
from hric_sweep.benchmark import definition, results, running, scoring, text
from hric_sweep.benchmark.definition import Benchmark, Controller
from hric_sweep.carrying import carry_out
from hric_sweep.engines.engine import going_on_with
from hric_sweep.engines.make import engine_arguments, engine_of
from hric_sweep.journal import Journal
from hric_sweep.task import code_version

FILE = "benchmark.yaml"
MEMORY = 4e9
"""That a worker may take [bytes]; project default, unconfirmed."""


class BenchmarkCommand(Command):
    """Compare controllers over collaborations, bodies and seeds: findings, ergonomics, task and robustness side by
    side, in one table, one page and one results file. Needs no ROS master."""

    epilog = (
        f"order: {scoring.RULE}  exit codes: 0; 2 a mistake, and nothing was begun; 3 runs failed (they count as "
        "such in the table), or --compare: not within the tolerance; 130 Ctrl-C (go on with --resume DIR)"
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument(
                "controllers",
                nargs="*",
                metavar="CONTROLLER",
                help=f"YAML files beside the references ({', '.join(definition.references())})",
            ),
            Argument("--without-references", action="store_true", help="only the controllers given"),
            Argument(
                "--definition", type=Path, metavar="FILE", help="another definition than the one that comes with it"
            ),
            Argument("--collaborations", nargs="+", default=[], metavar="NAME", help="only these"),
            Argument("--bodies", nargs="+", default=[], metavar="NAME", help="only these"),
            Argument("--seeds", type=int, metavar="N", help="only the first N seeds"),
            *engine_arguments("benchmark"),
            Argument(
                "--compare",
                type=Path,
                metavar="FILE",
                help="results of another laboratory: says what differs from them",
            ),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Run a new benchmark or go on with one, print and compare its results."""
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
        collaborations = found["collaborations"].values()
        failed = any(cell["failures"] for one in collaborations for cell in one["controllers"].values())
        return NOT_GOOD if failed else 0


def _folder(given: str) -> Path:
    folder = Path(given).expanduser()
    if not (folder / FILE).is_file():
        raise HricError(f"no benchmark in {folder}; valid: a folder with {FILE}")
    return folder


def _what(given: argparse.Namespace, folder: Path | None) -> tuple[Benchmark, dict[str, Any], list[Controller]]:
    """What is run: as given, or as it was begun."""
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
    """A new folder with benchmark.yaml."""
    folder = RunFolder.create(given.runs, "benchmark").path
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
    """Run a new benchmark, or go on; returns its folder and results."""
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
    return f"hric benchmark --resume {folder}"


def _bar(total: int, quiet: bool) -> Any:
    return tqdm(total=total, unit=" runs", desc="benchmark", disable=quiet or None)


def _compared(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> int:
    differences = results.compare(ours, theirs)
    share = f"{100.0 * ours['tolerance']:g} %"
    if not differences:
        print(f"within {share} of the other results")
        return 0
    print("\n".join([f"differs from the other results by more than {share}:", *(f"  {one}" for one in differences)]))
    return NOT_GOOD
