"""The Franka hand through libfranka's Python bindings, whose calls last as long as the motion, without waiting for
them."""

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
from hric_control.errors import FailureError
from hric_control.node import Node
from hric_control.parameters import Settings, choice

PORT = 1338
"""TCP port of the hand's service; fixed in libfranka."""
PROBE_TIMEOUT = 2.0
"""How long a hand may take to accept a connection [s of wall time]: project default, unconfirmed; libfranka's own
connect waits a minute."""
READ_PAUSE = 0.02
"""Between two readings of the state, so that other threads run even where reading holds the interpreter's lock [s]."""
RECONNECT_PERIOD = 1.0
"""Between attempts [s of wall time]."""
STOP_AGAIN = 0.1
"""After this a stop is sent again if the motion goes on: it may have come before the motion did [s]."""
LIBRARIES = {"panda_py": "panda_py.libfranka", "pylibfranka": "pylibfranka"}

Call = Callable[[Any], bool]


class LibfrankaHand:
    """A hand. One thread carries out the motions one after another, a second reads the state, a stop has one of its
    own.

    A new motion stops the one before first. The panda_py binding lets other threads run during a motion; pylibfranka's
    holds the interpreter's lock until it has ended, so that a stop comes too late there.

    Args:
        connect: makes libfranka's Gripper; raises when it cannot.
        report: takes one line of text when the connection is lost or is back.

    Attributes:
        width: opening between the fingers, as last read [m].
        is_grasped: whether an object is held, as last read.
        temperature: [degrees Celsius].
    """

    def __init__(self, connect: Callable[[], Any], report: Callable[[str], None]) -> None:
        self._connect, self._report = connect, report
        self._gripper = connect()
        self._lock, self._reading = threading.Condition(), threading.Lock()
        self._jobs: SimpleQueue[tuple[HandMotion, Call] | None] = SimpleQueue()
        self._waiting: list[HandMotion] = []  # motions that have not ended, in order
        self._busy: HandMotion | None = None  # the one that the hand carries out
        self._stops = 0  # on their way
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
        """Largest opening, known after homing [m]."""
        return self._max_width

    def homing(self) -> HandMotion:
        """Find the largest opening."""
        return self._begin("homing", lambda gripper: gripper.homing())

    def move(self, width: float, speed: float) -> HandMotion:
        """Go to an opening [m] at a speed [m/s]."""
        return self._begin("move", lambda gripper: gripper.move(width, speed))

    def grasp(self, width: float, epsilon_inner: float, epsilon_outer: float, speed: float, force: float) -> HandMotion:
        """Grasp something of a width [m], at most so much narrower and wider [m], at a speed [m/s] with a force [N]."""
        return self._begin("grasp", lambda gripper: gripper.grasp(width, speed, force, epsilon_inner, epsilon_outer))

    def stop(self) -> HandMotion:
        """End what runs or holds."""
        motion = HandMotion("stop")
        self._interrupt(motion)
        return motion

    def advance(self, time: float) -> None:
        """Nothing: a real hand goes by itself."""

    def close(self) -> None:
        """End what runs, and the threads."""
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
        """Send a stop from a thread of its own; no motion begins until it is done."""
        with self._lock:
            self._stops += 1
            busy = self._busy
            for motion in self._waiting:
                if motion is not busy:
                    motion.end(HandOutcome.ABORTED, "stopped before it began")
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
        """A motion has ended: read where, before anyone sees the end."""
        self._read_state()
        return good

    def _read(self) -> None:
        lost = False
        while not self._closed:
            try:
                if lost:
                    self._gripper = self._connect()
                self._read_state()
            except Exception as error:  # the bindings have errors of their own, and none of them may end the thread
                if not lost:
                    self._report(f"the hand does not respond: {error}")
                lost = True
                wall.sleep(RECONNECT_PERIOD)
                continue
            if lost:
                self._report("the hand responds again")
                lost = False
            wall.sleep(READ_PAUSE)


def _end(motion: HandMotion, call: Callable[[], bool]) -> None:
    """Make a call of libfranka and take over how it ended."""
    try:
        good = call()
    except Exception as error:  # RuntimeError of one binding, FrankaException of the other
        text = str(error)
        motion.end(HandOutcome.ABORTED if "aborted" in text.lower() else HandOutcome.FAIL, text)
        return
    motion.end(
        HandOutcome.SUCCESS if good else HandOutcome.UNSUCCESSFUL,
        "" if good else f"the hand did not reach the aim of the {motion.name}",
    )


def connector(address: str, library: str = "auto") -> Callable[[], Any]:
    """A function that connects to the hand at an address.

    Args:
        library: "panda_py", "pylibfranka", or "auto": the first that is installed; the hand's protocol is the same for
            Panda and FR3.

    Raises:
        HricError: no such library installed.
    """
    problems = []
    for name in LIBRARIES if library == "auto" else [library]:
        try:
            module = importlib.import_module(LIBRARIES[name])
        except ImportError as error:
            problems.append(f"{name}: {error}")
            continue
        return lambda: _connect(module, address)
    raise FailureError(f"no binding of libfranka for the hand: {'; '.join(problems)}")


def _connect(module: Any, address: str) -> Any:
    probe.check(address, PROBE_TIMEOUT, PORT)
    keep_local(address)
    try:
        return module.Gripper(address)
    except Exception as error:  # as above
        raise FailureError(f"no Franka hand at {address}: {error}") from error


@dataclass(frozen=True)
class HandSettings(Settings):
    """Parameters of the hand's node beside those of its actions."""

    robot_ip: str = ROBOT_IP
    wait_for_arm: float = WAIT_FOR_ARM
    library: str = choice(
        "auto", *LIBRARIES, text="binding of libfranka (franka_real); `auto`: the first of them that is installed"
    )


def hand_of_node(node: Node) -> tuple[LibfrankaHand, Callable[[], None]]:
    """The hand that the parameters `robot_ip` and `library` name, and what closes it.

    Raises:
        HricError: no hand there, or no such library.
    """
    settings = HandSettings.read(node)
    probe.wait(settings.robot_ip, PROBE_TIMEOUT, settings.wait_for_arm, PORT)
    hand = LibfrankaHand(connector(settings.robot_ip, settings.library), node.log_warn)
    node.log_info(f"connected to the hand at {settings.robot_ip}")
    return hand, hand.close
