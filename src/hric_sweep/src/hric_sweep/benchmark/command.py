"""Command `benchmark`: compare controllers over collaborative tasks, body sizes and seeds."""

import argparse
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from tqdm import tqdm

from hric_bags.run_folder import iso_now
from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD, HricError
from hric_core.parameters import read_yaml, whole
from hric_sweep.benchmark import definition, results, scoring, text
from hric_sweep.benchmark.definition import Benchmark, BenchmarkController
from hric_sweep.engines.make import engine_arguments, engine_session, resume_command
from hric_sweep.execution import execute
from hric_sweep.folder import begin
from hric_sweep.journal import Journal
from hric_sweep.records import PlainData
from hric_sweep.task import code_version

FILE = "benchmark.yaml"
MEMORY = 4e9
"""Memory limit of a worker [bytes]; project default, unconfirmed."""
CHOICES = ("without_references", "collaborations", "bodies", "seeds")
"""Options that, besides the definition and the controllers, choose the runs."""


class BenchmarkCommand(Command):
    """Compare controllers over collaborative tasks, body sizes and random seeds.

    Each controller is ranked by findings (contact and distance limits), ergonomics, task and robustness, in a table, a
    page and a results file. Needs no ROS master.
    """

    epilog = (
        f"order of the controllers: {scoring.RULE}  exit codes: 0 success; 2 user error, nothing was started; 3 runs "
        "failed (the table counts them), or results differ from --compare by more than the tolerance; 130 Ctrl-C "
        "(resume with --resume DIR)"
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        references = ", ".join(definition.references())
        return [
            Argument(
                "controllers",
                nargs="*",
                metavar="CONTROLLER",
                help=f"YAML files of controllers, compared with the reference controllers ({references})",
            ),
            Argument("--without-references", action="store_true", help="compare only the given controllers"),
            Argument(
                "--definition",
                metavar="FILE",
                help="YAML file of the benchmark (default: the benchmark of this workspace)",
            ),
            Argument("--collaborations", nargs="+", default=[], metavar="NAME", help="run only these collaborations"),
            Argument("--bodies", nargs="+", default=[], metavar="NAME", help="run only these body sizes"),
            Argument("--seeds", type=int, metavar="N", help="run only the first N seeds"),
            Argument(
                "--compare",
                type=Path,
                metavar="FILE",
                help="results file of another laboratory: print the differences beyond the tolerance",
            ),
            *engine_arguments("benchmark"),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Run a new benchmark, or resume one; print its results and compare them with those of --compare."""
        if arguments.seeds is not None:
            whole(minimum=1).checked(arguments.seeds, "--seeds")
        theirs = None if arguments.compare is None else results.read(arguments.compare)
        folder, code = _folder(arguments.resume), code_version()
        if folder is not None:
            before = read_yaml(folder / FILE)
            if before["code"] != code:
                raise HricError(
                    f"{folder} was started with code {before['code'][:12]}, but this is code {code[:12]}; valid: the "
                    "same code, or a new benchmark"
                )
            vars(arguments).update(before["given"])
        benchmark, content, controllers = _chosen(arguments)
        folder, ours = _run(folder, benchmark, content, controllers, code, arguments)
        print(text.render(ours))
        print(f"page: {folder / 'report.html'}\nresults: {folder / results.NAME}")
        if theirs is not None:
            return _compare(ours, theirs)
        cells = [cell for item in ours["collaborations"].values() for cell in item["controllers"].values()]
        return NOT_GOOD if any(cell["failures"] for cell in cells) else 0


def _folder(resume: str | None) -> Path | None:
    folder = None if resume is None else Path(resume).expanduser()
    if folder is not None and not (folder / FILE).is_file():
        raise HricError(f"no benchmark in {folder}; valid: a folder with {FILE}")
    return folder


def _chosen(options: argparse.Namespace) -> tuple[Benchmark, PlainData, list[BenchmarkController]]:
    """Return the checked benchmark, the content of its files, and the controllers that the options choose."""
    benchmark, content = definition.load(None if options.definition is None else Path(options.definition))
    benchmark = benchmark.only(options.collaborations, options.bodies, options.seeds)
    names = [*([] if options.without_references else definition.references()), *options.controllers]
    if not names:
        raise HricError("nothing to compare; valid: with --without-references, at least one CONTROLLER file")
    controllers = [definition.controller(name, benchmark) for name in names]
    if len({controller.name for controller in controllers}) < len(controllers):
        raise HricError(
            f"two controllers have the same name: {', '.join(controller.name for controller in controllers)}"
        )
    return benchmark, content, controllers


def _begin(options: argparse.Namespace, content: PlainData, code: str) -> Path:
    """Create the run folder of a benchmark with its settings in benchmark.yaml; return its path."""
    chosen = {key: getattr(options, key) for key in CHOICES}
    chosen["definition"] = options.definition and _absolute(options.definition)
    chosen["controllers"] = list(map(_absolute, options.controllers))
    head = {"started": iso_now(), "given": chosen, "definition": content}
    return begin(options.runs, "benchmark", FILE, head, code)


def _absolute(name: str) -> str:
    return str(Path(name).expanduser().resolve()) if name.endswith((".yaml", ".yml")) else name


def _run(
    folder: Path | None,
    benchmark: Benchmark,
    content: PlainData,
    controllers: Sequence[BenchmarkController],
    code: str,
    options: argparse.Namespace,
) -> tuple[Path, PlainData]:
    """Run a new benchmark (`folder` is None) or resume the one in `folder`; return its folder and results."""
    from hric_sweep.benchmark import page

    runs = definition.runs(benchmark, content["experiments"], controllers, code)
    started: Path | None = None
    with engine_session(options, MEMORY, len(runs), lambda: resume_command(started)) as engine:
        engine.check(next(iter(runs.values())))
        started = folder = folder or _begin(options, content, code)
        print(f"benchmark: {folder}", flush=True)
        bar = tqdm(total=len(runs), unit=" runs", desc="benchmark", disable=options.quiet or None)
        with Journal(folder) as journal, closing(bar):
            responses = execute(list(runs.values()), engine, journal, lambda _: bar.update())
    by_run = dict(zip(runs, responses, strict=True))
    made = results.make(benchmark, content, controllers, scoring.cells(benchmark, by_run), code)
    ours = {**made, "runs": results.run_rows(by_run)}
    results.write(folder, ours)
    page.write(folder, ours)
    return folder, ours


def _compare(ours: PlainData, theirs: PlainData) -> int:
    """Print the differences between two results and return the exit code."""
    differences = results.compare(ours, theirs)
    share = f"{100.0 * ours['tolerance']:g} %"
    if not differences:
        print(f"within {share} of the other results")
        return 0
    print("\n".join([f"differs from the other results by more than {share}:", *(f"  {line}" for line in differences)]))
    return NOT_GOOD
