"""Benchmark cases of whole runs: headless, and live with a ROS master."""

import resource
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cases import Block


@contextmanager
def again(simulator: str) -> Iterator[Block]:
    """Measure a headless run in a process that has already made one."""
    from hric_report import headless as runner
    from hric_run.definition import experiment

    given = [f"simulator:={simulator}"]
    with tempfile.TemporaryDirectory() as folder:

        def run() -> float:
            begin = time.process_time()
            runner.run(experiment.load("pd_step", given), given, root=Path(folder), progress=False, figures=False)
            return time.process_time() - begin

        run()
        yield run


@contextmanager
def fresh(simulator: str) -> Iterator[Block]:
    """Measure a headless run by the command in a new process."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["rosrun", "hric_experiments", "run", "pd_step", f"simulator:={simulator}", "--quiet", "--no-figures"]

        def run() -> float:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([*words, "--runs", folder], check=True, stdout=subprocess.DEVNULL)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

        yield run


@contextmanager
def live() -> Iterator[Block]:
    """Measure an unpaced live robot whose topics are recorded and received by a second subscriber."""
    from live_cost import measure_loop

    yield lambda: 1e-3 / measure_loop(3.0, 1)[0]["real-time factor, unpaced [1]"]
