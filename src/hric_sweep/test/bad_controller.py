"""Faulty controller of another package, and a sweep over its kinds of fault."""

import os
from collections.abc import Sequence
from pathlib import Path

import pytest
import test_sweep as sweeps
import yaml

from hric_run.definition import experiment

BAD = """\
import os
import time

from hric_control.controller import Controller


class Bad(Controller):
    def init(self, robot_hw, root_node, controller_node):
        self.how = controller_node.param("how")
        self.raises("raises in init")

    def starting(self, now):
        self.raises("raises in starting")

    def update(self, now, period):
        self.raises("raises")
        if now > 0.1:
            self.raises("raises late")
        if self.how == "ends":
            os._exit(7)
        if self.how == "takes all memory":
            self.taken = bytearray(20_000_000_000)
        while self.how == "hangs":
            time.sleep(1.0)

    def raises(self, how):
        if self.how == how:
            raise ValueError(f"{self} has no force")
"""
LATE = 0.1
"""Robot time at which the controller raises an error late in the run [s]."""
PACKAGE = (
    '<package format="3"><name>bad_runs</name><export><hric_control plugin="${prefix}/plugins.xml"/></export></package>'
)
PLUGINS = (
    '<library path="src"><class name="bad_runs/Bad" type="bad_module:Bad" base_class_type="hric_control::Controller">'
    "<description>-</description></class></library>"
)


def sweep(folder: Path, monkeypatch: pytest.MonkeyPatch, ways: Sequence[str], *, timeout: float = 60.0) -> Path:
    """Write a sweep file over kinds of fault; also add the controller's package to the package path."""
    package = folder / "packages" / "bad_runs"
    (package / "src").mkdir(parents=True)
    for name, content in {"package.xml": PACKAGE, "plugins.xml": PLUGINS, "src/bad_module.py": BAD}.items():
        (package / name).write_text(content)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{package.parent}:{os.environ['ROS_PACKAGE_PATH']}")
    base = yaml.safe_load(experiment.find("pd_step").read_text())
    base["controllers"].append("bad")
    base["parameters"]["bad"] = {"type": "bad_runs/Bad", "how": "not"}
    (folder / "base.yaml").write_text(yaml.safe_dump(base))
    how = {"paths": ["parameters.bad.how"], "distribution": {"kind": "choice", "values": list(ways)}}
    changes = {"vary": {"how": how}, "sampler": {"kind": "list"}, "runs": len(ways), "timeout": timeout}
    path = folder / "bad.yaml"
    path.write_text(
        yaml.safe_dump({**sweeps.SWEEP, "extends": "base.yaml", "sweep": {**sweeps.SWEEP["sweep"], **changes}})
    )
    return path
