"""Run folder of a sweep with its settings file sweep.yaml, from which a sweep is resumed or a run repeated."""

from pathlib import Path

from hric_bags import files
from hric_bags.run_folder import RunFolder, iso_now
from hric_core.parameters import read_yaml
from hric_run import provenance
from hric_sweep import definition
from hric_sweep.definition import SweepPlan
from hric_sweep.records import PlainData, ReferenceRun

FILE = "sweep.yaml"


def create(plan: SweepPlan, reference: ReferenceRun, root: Path) -> Path:
    """Create the run folder of a sweep with sweep.yaml in the folder of all runs; return its path."""
    content = {
        "name": plan.name,
        "started": iso_now(),
        "definition": plan.content,
        "experiment": plan.experiment,
        "reference": {"state_sha256": reference.state_sha256},
    }
    return begin(root, plan.name, FILE, content, reference.code)


def begin(root: Path, name: str, file: str, content: PlainData, code: str) -> Path:
    """Create a folder for runs with a file of `content` and provenance (code version, platform); return its path."""
    folder = RunFolder.create(root, name).path
    made_by = {
        "code": code,
        "revision": provenance.revision(),
        "versions": provenance.versions(),
        "platform": provenance.platform_info(),
    }
    files.write_yaml(folder / file, {**content, **made_by})
    return folder


def opened(folder: Path) -> tuple[SweepPlan, ReferenceRun]:
    """Return the plan and the reference run of an existing sweep.

    Raises:
        HricError: the stored definition is invalid with the current code.
    """
    content = read_yaml(folder / FILE)
    plan = definition.plan(content["name"], content["definition"], base=content["experiment"])
    return plan, ReferenceRun(content["code"], **content["reference"])
