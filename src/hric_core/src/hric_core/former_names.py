"""Import of moved modules by their former paths, which works until the next release and issues a warning."""

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, spec_from_loader
from types import ModuleType

FORMER = {
    "hric_assessment.supervisor": "hric_supervisor",
    "hric_control.plants.masks": "hric_control.plants.worlds",
    "hric_control.plants.resources": "hric_core.resources",
    "hric_control.robot_time.clock_pairs": "hric_control.clock_pairs",
    "hric_control.sim.pid": "hric_control.pid",
    "hric_controllers.joint.pid": "hric_control.pid",
    "hric_experiments.analysis": "hric_analysis",
    "hric_experiments.analysis.compare": "hric_report.compare",
    "hric_experiments.analysis.muscle_load": "hric_report.muscle_load",
    "hric_experiments.analysis.run": "hric_report.run",
    "hric_experiments.approaches": "hric_sweep.approaches",
    "hric_experiments.approaches.meetings": "hric_sweep.approaches.contact_events",
    "hric_experiments.benchmark": "hric_sweep.benchmark",
    "hric_experiments.definition": "hric_run.definition",
    "hric_experiments.definition.study": "hric_sweep.study.definition",
    "hric_experiments.headless.bag_writer": "hric_run.bag_writer",
    "hric_experiments.provenance": "hric_run.provenance",
    "hric_experiments.report": "hric_report",
    "hric_experiments.report_html": "hric_report.html",
    "hric_experiments.simulation": "hric_run.simulation",
    "hric_experiments.speed_map": "hric_measurements.speed_map",
    "hric_experiments.stops": "hric_measurements.stops",
    "hric_experiments.sweep": "hric_sweep",
    "hric_experiments.sweep_page": "hric_sweep.page",
    "hric_human.control.marked_body": "hric_human.control.marker_model",
    "hric_human.control.surroundings": "hric_human.control.human_control",
    "hric_human.muscles.fatigue": "hric_assessment.ergonomics.fatigue",
    "hric_human.muscles.live_load": "hric_motion.live_load",
    "hric_human.tracking": "hric_motion.tracking",
}
"""Present import path of packages and modules by their former path.

Modules that moved from hric_control to hric_core under the same name are found without an entry."""
HOMES = ("hric_assessment", "hric_control", "hric_controllers", "hric_experiments", "hric_human")
"""Packages from which modules were moved to other packages."""


def present(name: str) -> str | None:
    """Return the present path of a module that moved; None if it did not move or no longer exists."""
    package, _, rest = name.partition(".")
    if package not in HOMES or not rest:
        return None
    parts = name.split(".")
    for count in range(len(parts), 1, -1):
        if (moved := FORMER.get(".".join(parts[:count]))) is not None:
            return _existing(".".join([moved, *parts[count:]]))
    return _existing(f"hric_core.{rest}") if package == "hric_control" else None


def _existing(name: str) -> str | None:
    """Return `name` if there is a module of this name, else None."""
    try:
        return None if find_spec(name) is None else name
    except ModuleNotFoundError:  # not even its package
        return None


class _Finder(MetaPathFinder, Loader):
    """Import finder that returns the present module under its former name.

    It is called before Python's own finders, which would load a submodule of a renamed package a second time, with a
    second, incompatible set of classes.
    """

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        return None if present(name) is None else spec_from_loader(name, self)

    def exec_module(self, module: ModuleType) -> None:
        moved = present(module.__name__)
        assert moved is not None
        warnings.warn(f"{module.__name__} is {moved} now", DeprecationWarning, stacklevel=2)
        sys.modules[module.__name__] = import_module(moved)


def install() -> None:
    """Let this process import modules by their former paths."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())
