"""Moved modules can still be imported by their former paths, for scripts of users."""

import subprocess
import sys
from importlib import import_module

import pytest

from hric_core import former_names

MOVED = {
    "hric_control.errors": "HricError",
    "hric_control.geometry": "Pose",
    "hric_control.geometry.inertia": "__doc__",
    "hric_control.plants.masks": "masked",
    "hric_control.plants.resources": "__doc__",
    "hric_control.robot_time.clock": "__doc__",
    "hric_control.sim.pid": "Pid",
    "hric_control.trial.c3d": "read_trial",
    "hric_control.urdf.reading": "read",
    "hric_controllers.joint.pid": "PidGains",
    "hric_experiments.analysis.metrics": "__doc__",
    "hric_experiments.benchmark.definition": "load",
    "hric_experiments.definition.experiment": "load",
    "hric_experiments.report_html.page": "Page",
    "hric_experiments.simulation": "Simulation",
    "hric_experiments.sweep.definition": "load",
    "hric_human.control.marked_body": "MarkedBody",
    "hric_human.muscles.fatigue": "Fatigue",
}
"""A name defined in each moved module, by the former path of the module."""


@pytest.mark.parametrize("path", MOVED)
def test_former_path_gives_the_module(path: str) -> None:
    script = f"import {path}\nprint({path}.__name__, hasattr({path}, {MOVED[path]!r}))"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=60.0)
    assert done.stdout.split() == [former_names.present(path), "True"]


def test_module_is_loaded_once_under_both_paths() -> None:
    script = (
        "from hric_control.geometry.inertia import MassProperties as former\n"
        "from hric_core.geometry.inertia import MassProperties as present\n"
        "assert former is present"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=60.0)


@pytest.mark.parametrize("moved", former_names.FORMER.values())
def test_listed_module_exists(moved: str) -> None:
    assert import_module(moved)


def test_missing_module_is_reported_as_any_other() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"No module named 'hric_control\.no_such'"):
        import_module("hric_control.no_such")


def test_former_path_warns() -> None:
    script = "import warnings; warnings.simplefilter('error'); import hric_control.errors"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=60.0)
    assert "DeprecationWarning: hric_control.errors is hric_core.errors now" in done.stderr
