"""Program that runs commands with injected faults, each in a fork of a process that has loaded all modules.

It reads a list of cases (cells) as JSON from stdin, and writes their results to stdout. Keys of a case: call (file of
a node and arguments), working folder, environment of the fault shim, file for stderr, timeout [s].
"""

import importlib
import json
import os
import runpy
import signal
import sys
import time
import traceback
from typing import Any

LOADED = (
    "hric_experiments.cli",
    "hric_sweep.study.running",
    "hric_report.run",
    "hric_report.muscle_load",
    "hric_report.drawing",
    "hric_report.html.verdict",
    "hric_experiments.check_model.command",
    "hric_measurements.stops.command",
    "hric_measurements.speed_map.command",
    "hric_sweep.approaches.command",
    "hric_sweep.command",
    "hric_sweep.page.build",
    "hric_sweep.benchmark.command",
    "hric_sweep.benchmark.page",
    "hric_bags.export.exporting",
    "hric_bags.export.plain_formats",
    "hric_bags.health.command",
    "hric_assessment.verdict.command",
    "hric_gym.training",
    "hric_report.trial.command",
    "mujoco_ros_control.plant",
    "pybullet_ros_control.plant",
    "franka_sim.franka_hw_sim",
    "urdf_to_osim.cli",
    "matplotlib.pyplot",
    "pyarrow.parquet",
)


def run(cell: dict[str, Any]) -> int:
    """Run a program in this process and return its exit code."""
    os.chdir(cell["folder"])
    sys.argv = cell["call"]
    os.environ.update(cell["environment"])
    try:
        runpy.run_path(cell["call"][0], run_name="__main__")
        code: Any = 0
    except SystemExit as end:
        code = end.code
    except BaseException:
        traceback.print_exc()
        code = 1
    try:
        sys.stdout.flush()
    except OSError:
        traceback.print_exc()
        return 120
    return code if isinstance(code, int) else 0 if code is None else 1


def forked(cell: dict[str, Any]) -> int:
    """Run a case in a forked process; return its exit code, or minus the number of the signal that killed it."""
    child = os.fork()
    if not child:
        os.setsid()
        out = os.open(os.path.join(cell["folder"], "stdout.txt"), os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o644)
        err = os.open(cell["stderr"], os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o644)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(out, 1)
        os.dup2(err, 2)
        code = 1
        try:
            code = run(cell)
            sys.stderr.flush()
        finally:
            os._exit(code)
    deadline = time.monotonic() + cell["timeout"]
    while time.monotonic() < deadline:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return 124


def main() -> None:
    """Run all cases."""
    cells = json.load(sys.stdin)
    answer = os.fdopen(os.dup(1), "w")
    for name in LOADED:
        importlib.import_module(name)
    codes = []
    for cell in cells:
        began = time.process_time(), sum(os.times()[2:4])
        codes.append((forked(cell), round(sum(os.times()[2:4]) - began[1], 2)))
    json.dump(codes, answer)
    answer.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
