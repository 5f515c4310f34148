"""Real Franka hand through libfranka's Python bindings; threads execute their blocking calls."""

import importlib
import threading
import time as wall
from collections.abc import Callable
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

from franka_hw_interface.hand import HandMotion, HandOutcome
from franka_real import probe
from franka_real.backend import keep_local
from franka_real.settings import ROBOT_IP, WAIT_FOR_ARM
from hric_core.errors import FailureError
from hric_core.node import Node
from hric_core.parameters import Settings, choice

PORT = 1338
"""TCP port of the hand's service; fixed in libfranka."""
PROBE_TIMEOUT = 2.0
"""Maximum time for a connection [s of wall time]: project default, unconfirmed. libfranka itself waits a minute."""
READ_PAUSE = 0.02
"""Pause between two readings of the state [s]; lets other threads run if reading holds the interpreter's lock."""
RECONNECT_PERIOD = 1.0
"""Time between attempts to reconnect [s of wall time]."""
STOP_AGAIN = 0.1
"""Time after which a stop is repeated if the motion continues [s]: the stop may have come before the motion began."""
LIBRARIES = {"panda_py": "panda_py.libfranka", "pylibfranka": "pylibfranka"}

Call = Callable[[Any], bool]


class LibfrankaHand:
    """Real Franka hand. One thread executes the motions in turn, another reads the state; each stop has its own thread.

    A new motion stops the previous one first. The panda_py binding lets other threads run during a motion; pylibfranka
    holds the interpreter's lock until the motion has ended, so with it a stop has no effect on a running motion.

    Args:
        connect: function that creates libfranka's Gripper, or raises an error.
        report: callback for a line of text when the connection is lost or restored.

    Attributes:
        width: last measured opening between the fingers [m].
        is_grasped: True if an object was held at the last reading.
        temperature: temperature of the hand [degrees Celsius].
    """

    def __init__(self, connect: Callable[[], Any], report: Callable[[str], None]) -> None:
        self._connect, self._report = connect, report
        self._gripper = connect()
        self._lock, self._reading = threading.Condition(), threading.Lock()
        self._jobs: SimpleQueue[tuple[HandMotion, Call] | None] = SimpleQueue()
        self._waiting: list[HandMotion] = []  # motions that have not ended, in order
        self._busy: HandMotion | None = None  # the motion that the hand executes
        self._stops = 0  # number of stops in progress
        self._closed = False
        self._read_state()
        self._threads = [
            threading.Thread(target=run, name=f"hand_{run.__name__}", daemon=True)
            for run in (self._carry_out, self._read)
        ]
        for thread in self._threads:
            thread.start()

    def _read_state(self) -> None:
        with self._reading:
            state = self._gripper.read_once()
        self.width, self._max_width = float(state.width), float(state.max_width)
        self.is_grasped, self.temperature = bool(state.is_grasped), int(state.temperature)

    @property
    def max_width(self) -> float:
        """Maximum opening [m], which the hand measures during homing."""
        return self._max_width

    def homing(self) -> HandMotion:
        """Find the maximum opening."""
        return self._begin("homing", lambda gripper: gripper.homing())

    def move(self, width: float, speed: float) -> HandMotion:
        """Move to an opening [m] at a speed [m/s]."""
        return self._begin("move", lambda gripper: gripper.move(width, speed))

    def grasp(self, width: float, epsilon_inner: float, epsilon_outer: float, speed: float, force: float) -> HandMotion:
        """Grasp an object of a width [m] within two tolerances [m], at a speed [m/s] with a force [N]."""
        return self._begin("grasp", lambda gripper: gripper.grasp(width, speed, force, epsilon_inner, epsilon_outer))

    def stop(self) -> HandMotion:
        """End any motion or grasp."""
        motion = HandMotion("stop")
        self._interrupt(motion)
        return motion

    def advance(self, time: float) -> None:
        """Do nothing: a real hand moves by itself."""

    def close(self) -> None:
        """Stop the fingers if they move, and end the threads."""
        if self._waiting:
            self._interrupt(HandMotion("stop"))
        self._closed = True
        self._jobs.put(None)
        for thread in self._threads:
            thread.join(1.5)

    def _begin(self, name: str, call: Call) -> HandMotion:
        motion = HandMotion(name)
        if any(item.outcome is None for item in tuple(self._waiting)):
            self._interrupt(HandMotion("stop"))
        with self._lock:
            self._waiting.append(motion)
        self._jobs.put((motion, call))
        return motion

    def _interrupt(self, stop: HandMotion) -> None:
        """Abort all motions that wait and send a stop from a new thread; no motion starts before the stop has ended."""
        with self._lock:
            self._stops += 1
            busy = self._busy
            for motion in self._waiting:
                if motion is not busy:
                    motion.end(HandOutcome.ABORTED, f"the {motion.name} was stopped before it began")
        threading.Thread(target=self._send_stop, args=(stop, busy), name="hand_stop", daemon=True).start()

    def _send_stop(self, stop: HandMotion, busy: HandMotion | None) -> None:
        try:
            _end(stop, lambda: self._gripper.stop())
            while (
                busy is not None and busy.outcome is None and stop.outcome is HandOutcome.SUCCESS and not self._closed
            ):
                with self._lock:
                    self._lock.wait_for(lambda: busy.outcome is not None, STOP_AGAIN)
                if busy.outcome is None:
                    _end(HandMotion("stop"), lambda: self._gripper.stop())
        finally:
            with self._lock:
                self._stops -= 1
                self._lock.notify_all()

    def _carry_out(self) -> None:
        while (job := self._jobs.get()) is not None:
            motion, call = job
            with self._lock:
                self._lock.wait_for(lambda: self._stops == 0 or self._closed)
                if motion.outcome is None and not self._closed:
                    self._busy = motion
            if self._busy is motion:
                _end(motion, lambda call=call: self._done(call(self._gripper)))  # type: ignore[misc]  # binds the loop's value
            with self._lock:
                self._busy = None
                self._waiting.remove(motion)
                self._lock.notify_all()

    def _done(self, good: bool) -> bool:
        """Read the hand's state after a motion, before its outcome is set; return `good` unchanged."""
        self._read_state()
        return good

    def _read(self) -> None:
        lost = False
        while not self._closed:
            try:
                if lost:
                    self._gripper = self._connect()
                self._read_state()
            except Exception as error:  # each binding has its own errors, none of which may end the thread
                if not lost:
                    self._report(
                        f"the hand does not respond, reconnection is tried every {RECONNECT_PERIOD:g} s: {error}"
                    )
                lost = True
                wall.sleep(RECONNECT_PERIOD)
                continue
            if lost:
                self._report("the hand responds again")
                lost = False
            wall.sleep(READ_PAUSE)


def _end(motion: HandMotion, call: Callable[[], bool]) -> None:
    """Call libfranka, which blocks until the motion has ended, and store the outcome in the motion."""
    try:
        good = call()
    except Exception as error:  # RuntimeError of one binding, FrankaException of the other
        text = str(error)
        motion.end(HandOutcome.ABORTED if "aborted" in text.lower() else HandOutcome.FAIL, text)
        return
    motion.end(
        HandOutcome.SUCCESS if good else HandOutcome.UNSUCCESSFUL,
        "" if good else f"the {motion.name} ended without success: target width not reached, or no object held",
    )


def connector(address: str, library: str = "auto") -> Callable[[], Any]:
    """Return a function that connects to the hand at an address.

    Args:
        address: host name or IP of the hand.
        library: "panda_py", "pylibfranka", or "auto": the first that is installed; the hand's protocol is the same for
            Panda and FR3.

    Raises:
        HricError: none of these libraries is installed.
    """
    problems = []
    for name in LIBRARIES if library == "auto" else [library]:
        try:
            module = importlib.import_module(LIBRARIES[name])
        except ImportError as error:
            problems.append(f"{name}: {error}")
            continue
        return lambda: _connect(module, address)
    raise FailureError(f"no Python binding of libfranka for the hand is installed: {'; '.join(problems)}")


def _connect(module: Any, address: str) -> Any:
    probe.check(address, PROBE_TIMEOUT, PORT)
    keep_local(address)
    try:
        return module.Gripper(address)
    except Exception as error:  # as in `_end`
        raise FailureError(f"no connection to a Franka hand at {address}: {error}") from error


@dataclass(frozen=True)
class HandSettings(Settings):
    """Parameters of the node franka_gripper for the connection to a real hand, in addition to `GripperSettings`."""

    robot_ip: str = ROBOT_IP
    wait_for_arm: float = WAIT_FOR_ARM
    library: str = choice(
        "auto", *LIBRARIES, text="binding of libfranka (franka_real); `auto`: the first of them that is installed"
    )


def hand_of_node(node: Node) -> tuple[LibfrankaHand, Callable[[], None]]:
    """Connect to the hand that the node's parameters `robot_ip` and `library` describe.

    Returns:
        (hand, function that closes it).

    Raises:
        HricError: no hand responds, or the library is not installed.
    """
    settings = HandSettings.read(node)
    probe.wait(settings.robot_ip, PROBE_TIMEOUT, settings.wait_for_arm, PORT)
    hand = LibfrankaHand(connector(settings.robot_ip, settings.library), node.log_warn)
    node.log_info(f"connected to the hand at {settings.robot_ip}")
    return hand, hand.close
