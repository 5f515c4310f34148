"""Execution of one form (experiment with variants) of a study, as a sweep of recorded runs."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from hric_bags import files
from hric_bags.run_folder import RunFolder
from hric_core.errors import FailureError
from hric_sweep import definition
from hric_sweep.definition import ROW, SweepPlan
from hric_sweep.engines.pebble_engine import InProcessEngine
from hric_sweep.journal import Journal
from hric_sweep.study import tables
from hric_sweep.study.definition import Form
from hric_sweep.supervisor import SweepSupervisor
from hric_sweep.task import code_version


def plan_of(form: Form, arguments: Sequence[str], seed: int, root: Path) -> SweepPlan:
    """Return a form of a study as a sweep: a list of recorded runs that share one seed."""
    content = {
        "extends": form.experiment,
        "sweep": {
            "rows": {name: form.arguments(name, arguments) for name in form.runs},
            "sampler": {"kind": "list"},
            "seeds": "common",
            "seed": seed,
            "outputs": tables.OUTPUTS,
            "keep": {"worst": 0, "failed": False},
        },
    }
    return replace(definition.plan(Path(form.experiment).stem, content), runs_folder=str(root))


def execute(form: Form, arguments: Sequence[str], seed: int, folder: Path, *, progress: bool) -> dict[str, RunFolder]:
    """Execute the runs of a form that are not in its journal yet; return the folders of all its runs, by name.

    Args:
        form: form (experiment with variants) to run.
        arguments: overrides of the user, for all runs.
        seed: seed of all runs.
        folder: run folder of the study.
        progress: True to show a progress bar.

    Raises:
        FailureError: a run failed.
    """
    plan = plan_of(form, arguments, seed, folder.parent)
    files.make_folder(folder / form.name)
    bar = tqdm(total=len(form.runs), unit=" runs", desc=form.name, leave=False, disable=None if progress else True)
    with Journal(folder / form.name) as journal, closing(bar):
        engine, code = InProcessEngine(), code_version()
        supervisor = SweepSupervisor(plan, folder / form.name, journal, engine, code, lambda _: bar.update())
        supervisor.run()
    if failures := [f"{row.values[ROW]}: {row.failure}" for row in supervisor.rows.values() if row.failure]:
        raise FailureError(f"form {form.name}, run {'; '.join(failures)}")
    return {row.values[ROW]: RunFolder(folder.parent / row.run) for row in supervisor.rows.values()}
