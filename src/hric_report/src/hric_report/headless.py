"""Headless runner: simulates an experiment without ROS, as fast as the machine allows, and stores a run folder."""

import contextlib
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from hric_assessment.typed_json import JsonObject
from hric_bags import files
from hric_bags.files import FileError
from hric_bags.reader import ROS_TYPES, RunMessages
from hric_bags.run_file import RunFile, RunNotes
from hric_bags.run_folder import COMPLETED, INTERRUPTED, RunFolder, iso_now
from hric_bags.text import Steps
from hric_core.errors import HricError, failing
from hric_core.processes import uninterrupted
from hric_report.run import FIGURE_STEPS, STEPS, analyse
from hric_run import provenance
from hric_run.bag_writer import BagWriter
from hric_run.definition.experiment import Experiment
from hric_run.simulation import Simulation


@dataclass(frozen=True)
class HeadlessResult:
    """Result of a headless run.

    Attributes:
        folder: run folder.
        metrics: contents of metrics.json, plus the report text under "report".
        interrupted: True if Ctrl-C ended the run early.
    """

    folder: RunFolder
    metrics: JsonObject
    interrupted: bool


def run(
    definition: Experiment,
    arguments: Sequence[str] = (),
    *,
    seed: int = 0,
    root: Path,
    progress: bool = True,
    figures: bool = True,
) -> HeadlessResult:
    """Simulate an experiment and analyse the run.

    Args:
        definition: the experiment.
        arguments: overrides of the experiment as given by the user, for run.yaml.
        seed: seed of all random numbers.
        root: folder of all runs, in which the run folder is created.
        progress: True to show the progress of simulation and report on a terminal.
        figures: draw the figures.

    Raises:
        HricError: the experiment is invalid, and no folder was created; or the run failed: then run.yaml has its
            status, and the `exit_code` of the error is FAILURE.
    """
    with Simulation(definition, seed=seed) as simulation, contextlib.ExitStack() as until_recorded:
        tree, limits = simulation.tree, simulation.limits
        entries: RunFile = {"mode": "headless", "seed": seed, "limits": limits}
        with uninterrupted():  # a run folder has a run.yaml with its status
            folder = RunFolder.create(root, definition.name)
            folder.write(provenance.head(folder, definition, arguments, tree, entries))
            until_recorded.enter_context(folder.filled())
        files.write_text(folder.urdf_path, tree["robot_description"])
        messages, interrupted = _record(simulation, folder, progress)
    with failing(), contextlib.closing(Steps(STEPS + FIGURE_STEPS * figures)) as step:
        shown = step if progress and sys.stderr.isatty() else str
        metrics = analyse(folder, figures=figures, step=shown, known=messages)
    folder.update(state_sha256=metrics["state_sha256"])
    return HeadlessResult(folder, metrics, interrupted)


def _record(simulation: Simulation, folder: RunFolder, progress: bool) -> tuple[RunMessages, bool]:
    """Run the simulation and write the bag; return the messages for the report, and True if it was interrupted."""
    app, node = simulation.app, simulation.node
    interrupted, messages = False, RunMessages()
    failure: HricError | None = None
    with BagWriter(folder.bag_path) as bag:

        def write(topic: str, message: Any, at: float) -> None:
            nonlocal failure
            if isinstance(failure, FileError):
                return
            try:
                stamp = bag.write(topic, message, at)
            except FileError as error:  # the publisher is not at fault: stop the run instead of raising the error here
                failure = error
                app.stop()
            else:
                kind = ROS_TYPES.get(message._type)
                if kind is not None:
                    messages.add(topic, kind, stamp, message)

        folder.become_latest()
        write("/robot_description", String(node.param("robot_description")), 0.0)
        for early in simulation.early:
            write(*early)
        node.tap(write)
        began = time.perf_counter()
        try:
            simulation.run(progress=progress)
        except KeyboardInterrupt:
            interrupted = True
        except HricError as error:  # raised again once the bag is complete
            failure = failure or error
        if isinstance(failure, FileError):
            raise failure
        wall = time.perf_counter() - began
    if failure is not None:
        raise failure
    factor = round(app.cycles * app.hw.period / wall, 3)
    arm_error: RunNotes = {"arm_error": app.hw.error} if app.hw.error else {}
    status = INTERRUPTED if interrupted else COMPLETED
    folder.update(status=status, finished=iso_now(), real_time_factor=factor, **arm_error)
    return messages, interrupted
