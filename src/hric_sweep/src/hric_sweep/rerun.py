"""Commands `sweep rerun` (repeat one run of a sweep) and `sweep page` (rewrite the page of a sweep)."""

import argparse
from collections.abc import Sequence

from hric_bags.arguments import RUNS
from hric_core.command import Argument, Command
from hric_core.errors import HricError
from hric_sweep import definition, table, task
from hric_sweep.folder import opened
from hric_sweep.records import PlainData

FOLDER = Argument("sweep", help="run folder of the sweep, or its name within the folder of all runs")


class RerunCommand(Command):
    """Repeat one run of a sweep, and store it in a run folder with bag, metrics, figures and page.

    The hash of its states must equal the hash of the original run.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [FOLDER, Argument("id", help="id of the run, or its first characters"), RUNS]

    def run(self, arguments: argparse.Namespace) -> None:
        """Repeat one run of a sweep. Raises HricError: its states differ from those of the original run."""
        folder = table.find(arguments.sweep)
        plan, before = opened(folder)
        row = _row(table.read(folder).to_pylist(), arguments.id)
        repeated = plan.task(row["index"], {name: row[name] for name in plan.section.vary}, before.code)
        from hric_report import headless
        from hric_report import html as report_html

        result = headless.run(
            task.definition_of(repeated),
            definition.written(repeated.changes),
            seed=repeated.seed,
            root=arguments.runs,
        )
        print(f"{result.metrics['report']}\nrun folder: {result.folder.path}\npage: {report_html.write(result.folder)}")
        state = result.metrics["state_sha256"]
        if (
            plan.section.until != definition.ENDS[0]
        ):  # the recorded run lasts to the end of the experiment, so its hash differs
            state = task.run(repeated).state_sha256
        if state != row["state_sha256"]:
            raise HricError(
                f"the repeated run differs: state_sha256 is {state}; in the sweep it was {row['state_sha256']}: code "
                "or machine differ (sweep: "
                f"code {before.code[:12]}, here {task.code_version()[:12]})"
            )
        print(f"state_sha256: {row['state_sha256']}, as in the sweep")


def _row(rows: Sequence[PlainData], prefix: str) -> PlainData:
    matches = [row for row in rows if row["id"].startswith(prefix)]
    ids = {row["id"]: None for row in matches or rows}
    if not matches or len(ids) > 1:  # rows of a point that was sampled twice share one id
        some = ", ".join(list(ids)[:5])
        raise HricError(f"{len(ids) if matches else 0} runs have an id that begins with {prefix!r}; valid: {some}, ...")
    return matches[0]


class PageCommand(Command):
    """Rewrite the page of a sweep, report.html, from its table."""

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [FOLDER]

    def run(self, arguments: argparse.Namespace) -> None:
        """Rewrite the page of the sweep and print its path."""
        from hric_sweep.page import build as page

        print(f"page: {page.write(table.find(arguments.sweep))}")
