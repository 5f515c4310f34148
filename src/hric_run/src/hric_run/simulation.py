"""Simulation of an experiment in this process, without a ROS master, as fast as the machine allows."""

import contextlib
import copy
import signal
import threading
from collections.abc import Iterator, Mapping, Sequence
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any, Protocol

from std_msgs.msg import Float64MultiArray
from std_srvs.srv import TriggerRequest
from tqdm import tqdm

from hric_bags.reader import ControlRecord, stitch
from hric_control.hardware_interface import JointStateInterface
from hric_control.robot_app import RobotApp
from hric_core.errors import FailureError, HricError, failing
from hric_core.local.node import LocalNode
from hric_msgs.msg import ControlLog
from hric_run import provenance, stepping
from hric_run.definition import experiment, parameters
from hric_run.definition.experiment import Experiment, Setpoint
from hric_run.definition.overrides import in_yaml

if TYPE_CHECKING:
    from hric_run.observation import Observer, SimulationState
    from hric_run.stepping import Command
    from hric_supervisor.app import HeadlessSupervisor

PROGRESS_PERIOD = 0.05
"""Robot time between two updates of the progress bar [s]."""
Message = tuple[str, Any, float]
"""Published message: (topic, message, robot time [s])."""


class Simulation:
    """Simulation of an experiment: robot, controller manager and controllers in one process, on a `LocalNode`.

        with Simulation("pd_step", kp=200) as simulation:
            simulation.run()
            overshoot = simulation.signals.position.max(axis=0)   # (7,) [rad]

    The same experiment with the same seed gives bit for bit the same result, in a new process as after a thousand runs
    in this one: `reset` constructs robot and controllers again, or with `in_place` returns them to their start.

    For a caller that sends commands between short parts of a run, as in reinforcement learning:

        simulation.command("joint_pd_controller", q)           # as from the controller's topic
        simulation.advance(40)                                 # control cycles of 1 ms
        simulation.observe().arm.T_base_ee                     # (4, 4)

    Args:
        name: name of the experiment, path of a YAML file, or the experiment itself.
        seed: seed of all random numbers.
        overrides: overrides as on the command line, `kp=200`; a dotted key as `**{"robot.plant.friction": "none"}`.

    Attributes:
        definition: the experiment, with overrides applied.
        seed: seed of all random numbers.
        node: node of the robot's namespace, to publish, subscribe, and call services.
        app: robot and controller manager.
        parts: each controller manager with its robot and controllers: of `app`, and then of each arm of several.
        tree: all parameters of the run.
        limits: limits by joint name, see `provenance.joint_limits`.
        early: messages that were published before the first cycle.
        supervisor: supervisor, if the experiment has a section `supervisor`, else None.

    Raises:
        HricError: the experiment does not exist, has a mistake, or cannot run without ROS.
    """

    def __init__(self, name: str | Experiment, /, *, seed: int = 0, **overrides: Any) -> None:
        self._name, self._overrides, self.seed = name, overrides, seed
        self.supervisor: HeadlessSupervisor | None = None
        self._open()

    def _open(self) -> None:
        self.definition = _definition(self._name, self._overrides)
        refuse_wires(self.definition)
        self.tree = _tree(self.definition, self.seed)
        node = self.node = LocalNode(self.tree)
        mocap = self.definition.mocap
        person = parameters.person(self.definition) if mocap is not None and mocap.measures_person else {}
        steppers: list[Stepper] = [sensor.headless(node) for sensor in self.definition.sensors]
        if mocap is not None:
            # Imported only for runs with motion capture.
            from hric_run.headless_human import HeadlessHuman

            announced = bool(steppers) or mocap.human.get("program") == "c3d"
            steppers.insert(0, HeadlessHuman(node, mocap.build(self.seed, person), announced))
        added = [section.headless(node, self.seed) for section in self.definition.added_sections.values()]
        steppers += [stepper for stepper in added if stepper is not None]
        self.app = RobotApp(node, node.child(parameters.ROBOT))
        self.parts = stepping.controlled_robots(self.app, node, self.definition)
        try:
            self.limits, self.early = self._prepare()
        except BaseException:
            self.app.shutdown()
            raise
        for part in self.parts:  # includes values that the plant chose
            self.tree |= {part.prefix.rstrip("/") or parameters.ROBOT: node.param(part.prefix or parameters.ROBOT)}
        starts = [] if self.definition.human is None else [parameters.HUMAN_START]
        if self.definition.supervisor is not None:
            steppers.append(self._supervised(node))
        self._timeline = Timeline(node, self.definition.all_setpoints, steppers, starts)
        self._observer: Observer | None = None
        self._commands = stepping.Commands(node, [name for part in self.parts for name in part.controllers])
        self._log: list[Any] = []
        node.subscribe("control_log", ControlLog, self._log.append)

    def _supervised(self, node: LocalNode) -> "HeadlessSupervisor":
        # Imported only for runs with a supervisor.
        from hric_supervisor.app import HeadlessSupervisor

        try:
            self.supervisor = HeadlessSupervisor(
                node.child(parameters.SUPERVISOR), lambda service, _, request: node.call(service, request)
            )
        except BaseException:
            self.app.shutdown()
            raise
        return self.supervisor

    def _prepare(self) -> tuple[dict[str, dict[str, float]], list[Message]]:
        """Check the setpoints, and load and start the controllers; errors are raised before any file is written.

        Returns:
            limits by joint name, and the messages that were published meanwhile.
        """
        app, node, definition = self.app, self.node, self.definition
        names = app.hw.get(JointStateInterface).names
        limits = provenance.joint_limits(node.param("robot_description"), node, names)
        for setpoint in definition.all_setpoints:
            setpoint.check_reachable(node.param(setpoint.controller, {}).get("joints", names), limits)
        early: list[Message] = []
        tap = node.tap(lambda topic, message, time: early.append((topic, copy.deepcopy(message), time)))
        for part in self.parts:
            part.load_controllers()
        tap.unregister()
        for name in dict.fromkeys(setpoint.controller for setpoint in definition.all_setpoints):
            command = node.advertise(f"{name}/command", Float64MultiArray)
            if not command.subscribers():
                raise HricError(
                    f"setpoints of {name} have no effect: this controller does not subscribe to {name}/command; valid: "
                    "a controller that does"
                )
            command.unregister()
        return limits, early

    # -- running -------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated robot time so far [s]."""
        return float(self.app.cycles * self.app.hw.period)

    def run(self, duration: float | None = None, *, progress: bool = False) -> None:
        """Run the simulation, or continue it after an earlier call.

        Args:
            duration: robot time for which to run [s]; None: until the end of the experiment.
            progress: True to show a progress bar on a terminal.

        Raises:
            KeyboardInterrupt: Ctrl-C or SIGTERM; the present cycle is completed, and `signals` has all cycles.
            HricError: the robot failed, or a controller was stopped by an error.
        """
        left = self.definition.duration - self.time if duration is None else duration
        form = "{l_bar}{bar}| {n:.2f}/{total:.2f} s robot time [{elapsed}<{remaining}]"
        # disable=None: no bar if stderr is not a terminal, as a file would contain hundreds of its states.
        options = {"desc": self.definition.name, "bar_format": form, "leave": False, "disable": None}
        with (
            tqdm(total=left, **options) if progress else contextlib.nullcontext() as self._timeline.bar,
            _interruptible(self.app) as interrupt,
        ):
            self.app.run(left, self._timeline)
        if interrupt.is_set():
            raise KeyboardInterrupt
        self._refuse_stopped()

    def _refuse_stopped(self) -> None:
        """Raise HricError if an error has stopped a controller."""
        failed = [text for part in self.parts for text in part.failures()]
        if failed:
            raise FailureError(f"experiment {self.definition.name}: {'; '.join(failed)}")

    def advance(self, cycles: int) -> None:
        """Run a number of control cycles, without progress bar, signal handlers, and the messages at the end of `run`.

        Args:
            cycles: number of cycles, 1 or more.

        Raises:
            HricError: the robot failed, or an error has stopped a controller.
        """
        if cycles < 1:
            raise HricError(f"cycles is {cycles}; valid: at least 1")
        app, timeline, stop = self.app, self._timeline, self.app.hw.stop
        last = app.cycles + cycles

        def cycle(time: float, period: float, reset_controllers: bool) -> bool:
            timeline(time)
            going_on = app.on_cycle(time, period, reset_controllers)
            if app.cycles >= last:
                stop()
            return going_on

        app.manager.loop_running = True
        try:
            with failing():
                app.hw.run(cycle)
        finally:
            app.manager.loop_running = False
        self._refuse_stopped()

    def command(self, controller: str, command: "Command") -> None:
        """Send a command to a controller, which checks it like a message on its topic.

        Args:
            controller: name of the controller.
            command: numbers for its topic `command` (Float64MultiArray), or an equilibrium pose in the robot's base for
                its topic `equilibrium_pose`.

        Raises:
            HricError: nothing subscribes to this topic, or the controller refuses the command.
        """
        self._commands.send(controller, command)

    def observe(self) -> "SimulationState":
        """Return the present state of arm and person, contacts and distance, as NumPy arrays.

        Raises:
            DescriptionError: a link of the robot has no capsule, so that its distance from a person is not known.
        """
        if self._observer is None:
            # Imported only for callers that observe.
            from hric_run.observation import Observer

            self._observer = Observer(self.node, stepping.simulated(self.app))
        return self._observer.observe()

    def reset(
        self,
        *,
        seed: int | None = None,
        in_place: bool = False,
        q_start: Sequence[float] | None = None,
        **overrides: Any,
    ) -> None:
        """Return to the beginning of the experiment, with robot and controllers constructed again.

        Args:
            seed: new seed; None: the seed is not changed.
            in_place: True: return the existing robot, plant and controllers to their start state. The following run has
                bit for bit the same result, and the reset takes a tenth of the time or less.
            q_start: new start position of the robot, n floats [rad or m]; None: it is not changed.
            overrides: further overrides, in addition to the earlier ones; not with `in_place`.

        Raises:
            HricError: the experiment cannot run (the simulation is then closed), or cannot be reset in place.
        """
        if in_place:
            self._return_to_start(self.seed if seed is None else seed, q_start, overrides)
            return
        if q_start is not None:
            overrides |= {"robot.q_start": [float(value) for value in q_start]}
        self.close()
        self.seed = self.seed if seed is None else seed
        self._overrides = self._overrides | overrides
        self._open()

    def _return_to_start(self, seed: int, q_start: Sequence[float] | None, overrides: Mapping[str, Any]) -> None:
        if overrides:
            raise HricError(f"{', '.join(overrides)} cannot be changed by a reset in place; valid: seed, q_start")
        if self._timeline.steppers:
            raise HricError(
                f"{self.definition.name} has motion capture, sensors or a supervisor, which have no reset in place; "
                "valid: reset(), or an experiment without them"
            )
        if q_start is not None:
            stepping.set_start(self.app, self.node, q_start)
        self.seed = seed
        stepping.return_to_start(self.app, self.node, self.definition, self.parts, seed)
        self._flush_log()
        self._log.clear()
        if self._observer is not None:
            self._observer.restart()
        starts = [] if self.definition.human is None else [parameters.HUMAN_START]
        self._timeline.close()
        self._timeline = Timeline(self.node, self.definition.all_setpoints, [], starts)

    def _flush_log(self) -> None:
        """Publish the last rows of the control log, which `advance` has not published yet."""
        if self.app.log is not None:
            self.app.log.complete()
            self.app.log.flush()

    # -- results -------------------------------------------------------------------------------------------------------

    @property
    def signals(self) -> ControlRecord:
        """Time, joint positions, velocities, efforts and commands of every cycle so far, as arrays.

        Raises:
            HricError: there is no cycle yet, or the robot has no control log.
        """
        self._flush_log()
        return stitch(self._log)

    @property
    def state_sha256(self) -> str:
        """SHA-256 hash of all positions, velocities and commands so far, bit for bit, as recorded in run.yaml."""
        return self.signals.state_sha256()

    # -- the end -------------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Release the robot; `signals` remains available."""
        self.app.shutdown()

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def check(definition: Experiment) -> None:
    """Check an experiment without running it: construct its robot, controllers and sensors, and release them.

    Raises:
        HricError: the experiment cannot run.
    """
    Simulation(definition).close()


def _definition(name: str | Experiment, overrides: dict[str, object]) -> Experiment:
    if not isinstance(name, Experiment):
        return experiment.load(name, [f"{key}:={in_yaml(value)}" for key, value in overrides.items()])
    if overrides:
        raise HricError(
            f"overrides ({', '.join(overrides)}) cannot be applied to an Experiment object; valid: the name or file of "
            "an experiment"
        )
    return name


def _tree(definition: Experiment, seed: int) -> dict[str, Any]:
    """Return all parameters of a run, as a live run has them on the parameter server."""
    namespace = parameters.namespace(definition, seed)
    return {
        **parameters.global_tree(definition),
        **namespace,
        parameters.ROBOT: namespace[parameters.ROBOT] | {"real_time_factor": 0.0},
        **parameters.mocap(definition, seed),
        **parameters.sensors(definition, seed),
        **parameters.supervisor(definition),
    }


def refuse_wires(definition: Experiment) -> None:
    """Refuse an experiment with devices that stream over a network, which cannot follow an unpaced simulation.

    Emulated devices run within this process and are allowed. A supervisor with the source `person` is refused, too, as
    no node tracks a person here.
    """
    if "person" in (definition.supervisor or {}).get("source", ()):
        raise HricError(
            f"{definition.name}: supervisor.source person needs a tracking node, which a headless run does not have; "
            f"valid: scripts/bringup experiment:={definition.name}, or another source"
        )
    wired = [sensor.wire for sensor in definition.sensors if sensor.wire] + ["sync"] * (definition.sync is not None)
    if wired:
        raise HricError(
            f"{definition.name} has {', '.join(wired)}, which needs a network connection and cannot run headless; "
            f"valid: scripts/bringup experiment:={definition.name}"
        )


class Stepper(Protocol):
    """Part of a simulation that advances in step with the robot, such as a sensor or a supervisor."""

    def advance(self, time: float) -> None:
        """Advance to a robot time [s]."""


class Timeline:
    """Callback in each cycle before the controllers: sends due setpoints, advances sensors, updates the progress bar.

    The first cycle starts the controllers. So the earliest setpoint is sent in the second cycle, 1 ms later, and so is
    the first motion capture frame.

    Args:
        node: node of the robot's namespace.
        setpoints: setpoints in order of time.
        steppers: parts that advance in step with the robot: the tracked human, sensors, the supervisor.
        starts: names of services that are called in the second cycle, such as that which starts the human.

    Attributes:
        bar: progress bar over robot time; None: no bar.
        steppers: as in Args.
    """

    def __init__(
        self, node: LocalNode, setpoints: Sequence[Setpoint], steppers: Sequence[Stepper], starts: Sequence[str]
    ) -> None:
        self._node, self._starts = node, list(starts)
        self._waiting = list(setpoints)
        self._publishers = {
            p.controller: node.advertise(f"{p.controller}/command", Float64MultiArray) for p in setpoints
        }
        self._shown, self._started, self.steppers = 0.0, False, steppers
        self.bar: Any = None

    def __call__(self, now: float) -> None:
        """Execute everything that is due at robot time `now` [s]."""
        if not self._started:
            self._started = True
            return
        while self._starts:
            self._node.call(self._starts.pop(), TriggerRequest())
        while self._waiting and now >= self._waiting[0].time - 1e-9:
            setpoint = self._waiting.pop(0)
            self._publishers[setpoint.controller].publish(Float64MultiArray(data=list(setpoint.positions)))
        for stepper in self.steppers:
            stepper.advance(now)
        if self.bar is not None and now - self._shown >= PROGRESS_PERIOD:
            self.bar.update(round(now - self._shown, 3))
            self._shown = now

    def close(self) -> None:
        """Stop advertising the topics of the setpoints."""
        for publisher in self._publishers.values():
            publisher.unregister()


@contextlib.contextmanager
def _interruptible(app: RobotApp) -> Iterator[threading.Event]:
    """Let Ctrl-C and SIGTERM end the run after the present cycle, so that log and bag are complete.

    The returned event is set by such a signal. In a thread other than the main one, which gets no signals, this has no
    effect.
    """
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
