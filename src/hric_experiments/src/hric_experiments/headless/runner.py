"""The headless runner: robot, manager and controllers of the live system on a LocalNode, as fast as the machine
allows."""

import contextlib
import copy
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from std_msgs.msg import Float64MultiArray, String
from tqdm import tqdm

from franka_msgs.msg import FrankaState
from hric_bags import files
from hric_bags.run_folder import COMPLETED, INTERRUPTED, RunFolder, iso_now
from hric_bags.text import Steps
from hric_control.errors import FailureError, HricError, failing
from hric_control.hardware_interface import JointStateInterface
from hric_control.local.node import LocalNode
from hric_control.robot_app import RobotApp
from hric_experiments import provenance
from hric_experiments.analysis.run import FIGURE_STEPS, STEPS, analyse
from hric_experiments.definition import parameters
from hric_experiments.definition.experiment import Experiment, Setpoint
from hric_experiments.headless.bag_writer import BagWriter
from hric_perception.human import CapturedHuman
from hric_perception.human.truth import Truth
from mocap_natnet.headless import HeadlessMocap, robot_time
from mocap_natnet.node.parameters import Publishing
from mocap_natnet.node.publisher import MocapPublisher

PROGRESS_PERIOD = 0.05
"""Robot time between two updates of the progress bar [s]."""


@dataclass(frozen=True)
class Result:
    """What a headless run leaves.

    Attributes:
        folder: the run folder.
        metrics: contents of metrics.json, plus the report text under "report".
        interrupted: whether Ctrl-C ended it before its time.
    """

    folder: RunFolder
    metrics: dict[str, Any]
    interrupted: bool


STATE_TOPIC = "franka_state_controller/franka_states"


class HeadlessHuman:
    """The emulated human, the Motive that sees him and its client, without sockets, with the same codec.

    Moves with robot time; the program's time 0 is the first `advance`.

    Args:
        node: the robot's namespace, with the parameters of the motion capture's nodes.
        seen: the human, and the Motive that sees him.

    Raises:
        HricError: a parameter that does not suit a run without a network.
    """

    def __init__(self, node: LocalNode, seen: CapturedHuman) -> None:
        self._hand, self._started = seen.hand, False
        publisher = MocapPublisher(node, Publishing.read(node.child(parameters.MOCAP_CLIENT)), robot_time)
        self._mocap = HeadlessMocap(seen.motive, publisher)
        self._truth = Truth(node, seen.hand, node.param(f"{parameters.EMULATED_HUMAN}/base_frame"))
        node.subscribe(STATE_TOPIC, FrankaState, self._on_state)

    def _on_state(self, message: Any) -> None:
        x, y, z = message.O_T_EE[12:15]
        self._hand.see(message.header.stamp.to_sec(), (x, y, z))

    def advance(self, time: float) -> None:
        """Go on to a time of the run [s]."""
        if not self._started:
            self._started = True
            self._hand.start(time)
        self._mocap.advance(time)
        self._truth.advance(time)


class Timeline:
    """Sends the setpoints at their times, lets the human move, and the progress bar; called in the loop before
    each update.

    The first cycle starts the controllers, so the earliest setpoint goes out in the second one, 1 ms later, and so
    does the first frame.

    Args:
        node: the robot's namespace.
        setpoints: in order of time.
        bar: shows robot time; None: no bar.
        human: before the motion capture; None: none.
    """

    def __init__(
        self, node: LocalNode, setpoints: Sequence[Setpoint], bar: Any, human: HeadlessHuman | None = None
    ) -> None:
        self._waiting = list(setpoints)
        self._publishers = {
            p.controller: node.advertise(f"{p.controller}/command", Float64MultiArray) for p in setpoints
        }
        self._bar, self._shown, self._started, self._human = bar, 0.0, False, human

    def __call__(self, now: float) -> None:
        """Do what is due at robot time `now` [s]."""
        if not self._started:
            self._started = True
            return
        while self._waiting and now >= self._waiting[0].time - 1e-9:
            setpoint = self._waiting.pop(0)
            self._publishers[setpoint.controller].publish(Float64MultiArray(data=list(setpoint.positions)))
        if self._human is not None:
            self._human.advance(now)
        if self._bar is not None and now - self._shown >= PROGRESS_PERIOD:
            self._bar.update(round(now - self._shown, 3))
            self._shown = now


def run(
    definition: Experiment,
    arguments: Sequence[str] = (),
    *,
    seed: int = 0,
    root: Path,
    progress: bool = True,
    figures: bool = True,
) -> Result:
    """Run an experiment and analyse it.

    Args:
        definition: the experiment.
        arguments: the overrides it was made with, for run.yaml.
        seed: of everything random.
        root: folder of all runs.
        progress: show on a terminal how far run and report are.
        figures: draw.

    Raises:
        HricError: the experiment cannot run, and no folder was made: a mistake of the user; or it failed on its way,
            and run.yaml says so: `exit_code` FAILURE.
    """
    _refuse_wires(definition)
    tree = _tree(definition, seed)
    node = LocalNode(tree)
    human = HeadlessHuman(node, definition.mocap.build(seed)) if definition.mocap is not None else None
    app = RobotApp(node, node.child(parameters.ROBOT))
    try:
        limits, early = _prepared(app, node, definition)
        folder = RunFolder.create(root, definition.name)
        head = provenance.head(folder, definition, arguments, tree, mode="headless", seed=seed, limits=limits)
        folder.write(head)
        files.write_text(folder.urdf_path, tree["robot_description"])
        with folder.filled():
            interrupted = _simulate(app, node, definition, folder, early, progress, human)
    finally:
        app.shutdown()
    with failing(), contextlib.closing(Steps(STEPS + FIGURE_STEPS * figures)) as step:
        metrics = analyse(folder, figures=figures, step=step if progress and sys.stderr.isatty() else str)
    folder.update(state_sha256=metrics["state_sha256"])
    return Result(folder, metrics, interrupted)


def _tree(definition: Experiment, seed: int) -> dict[str, Any]:
    """All parameters, as a live run has them on the server."""
    return {
        "robot_description": parameters.description(definition.robot),
        "joint_limits": parameters.joint_limits(definition),
        **parameters.controllers(definition),
        parameters.ROBOT: parameters.robot(definition, seed) | {"real_time_factor": 0.0},
        **parameters.mocap(definition, seed),
    }


def _refuse_wires(definition: Experiment) -> None:
    """Sensors that come by wire cannot follow a run that is not paced."""
    wired = [sensor.name for sensor in definition.sensors] + ["sync"] * (definition.sync is not None)
    if wired:
        raise HricError(
            f"{definition.name} has {', '.join(wired)}, which come by wire; valid: scripts/bringup "
            f"experiment:={definition.name}"
        )


Early = list[tuple[str, Any, float]]
"""Messages from before there was a bag: topic, message, robot time."""


def _prepared(app: RobotApp, node: LocalNode, definition: Experiment) -> tuple[dict[str, dict[str, float]], Early]:
    """Load and start the controllers, so that all that can be refused is before anything is written.

    Returns:
        limits per joint, and what was published.
    """
    names = app.hw.get(JointStateInterface).names
    limits = provenance.joint_limits(node.param("robot_description"), node, names)
    for setpoint in definition.setpoints:
        parameters.check_setpoint(setpoint, node.param(setpoint.controller, {}).get("joints", names), limits)
    early: Early = []
    tap = node.tap(lambda topic, message, time: early.append((topic, copy.deepcopy(message), time)))
    for name in definition.controllers:
        app.manager.load(name)
    app.manager.switch(list(definition.controllers), [], loop_running=False)
    tap.unregister()
    return limits, early


def _simulate(
    app: RobotApp,
    node: LocalNode,
    definition: Experiment,
    folder: RunFolder,
    early: Early,
    progress: bool,
    human: HeadlessHuman | None,
) -> bool:
    """Run the robot into the bag. Returns whether it was interrupted."""
    with BagWriter(folder.bag_path) as bag:
        folder.become_latest()
        bag.write("/robot_description", String(node.param("robot_description")), 0.0)
        for topic, message, at in early:
            bag.write(topic, message, at)
        node.tap(bag.write)
        began = time.perf_counter()
        failure, interrupted = None, False
        try:
            interrupted = _run(app, node, definition, progress, human)
        except HricError as error:  # the robot ended the run: raised when the bag, with all its cycles, is whole
            failure = error
        wall = time.perf_counter() - began
    if failure is not None:
        raise failure
    factor = round(app.cycles * app.hw.period / wall, 3)
    arm_error = {"arm_error": app.hw.error} if app.hw.error else {}
    status = INTERRUPTED if interrupted else COMPLETED
    folder.update(status=status, finished=iso_now(), real_time_factor=factor, **arm_error)
    _check_controllers(app, definition, interrupted)
    return interrupted


def _run(app: RobotApp, node: LocalNode, definition: Experiment, progress: bool, human: HeadlessHuman | None) -> bool:
    form = "{l_bar}{bar}| {n:.2f}/{total:.2f} s robot time [{elapsed}<{remaining}]"
    # disable=None: where stderr is no terminal there is no bar, whose hundreds of states a file would keep.
    shown = {"desc": definition.name, "bar_format": form, "leave": False, "disable": None}
    bar = tqdm(total=definition.duration, **shown) if progress else None
    try:
        with _interruptible(app) as interrupt:
            app.run(definition.duration, Timeline(node, definition.setpoints, bar, human))
    finally:
        if bar is not None:
            bar.close()
    return interrupt.is_set()


@contextlib.contextmanager
def _interruptible(app: RobotApp) -> Iterator[threading.Event]:
    """Ctrl-C and SIGTERM end the run after the present cycle, so that log and bag stay whole. Only the main thread gets
    signals."""
    interrupt = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield interrupt
        return

    def stop(_: int, __: FrameType | None) -> None:
        interrupt.set()
        app.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield interrupt
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _check_controllers(app: RobotApp, definition: Experiment, interrupted: bool) -> None:
    failed = [status.name for status in app.manager.list() if status.state == "aborted"]
    if failed and not interrupted:
        raise FailureError(
            f"experiment {definition.name}: controller {', '.join(failed)} was stopped by an error; its message is "
            "above"
        )
