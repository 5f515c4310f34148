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
    """Create the folder of a sweep or benchmark and write its settings file; return the path of the folder.

    Args:
        root: folder of all runs.
        name: beginning of the folder's name.
        file: name of the settings file (YAML).
        content: settings; provenance (revision, versions, platform) is added.
        code: version of the code that was used.
    """
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
