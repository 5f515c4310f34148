"""Part of the controller manager that runs in the control loop: updates of controllers, and switches between cycles."""

import math
import signal
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter

from hric_control.manager.loaded_controller import ControllerState, LoadedController
from hric_control.manager.switching import SwitchRequest
from hric_control.robot_hw import RobotHW
from hric_core.errors import HricError


def describe(error: BaseException) -> str:
    """Return an error as one line: the text of a HricError; type, text, file name and line of any other error."""
    if isinstance(error, HricError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    source = f" ({Path(frames[-1].filename).name}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{source}"


def pass_ctrl_c(error: BaseException) -> None:
    """Raise a KeyboardInterrupt again if Ctrl-C caused it, which is so in a script that does not handle SIGINT.

    Commands and nodes handle the signal, so that there a KeyboardInterrupt was raised by a controller itself."""
    if isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        raise error


class ManagerLoop:
    """Loop part of the manager: updates the running controllers and executes one switch request at a time.

    Args:
        robot_hw: the robot.
        report: function that logs a line of error text; must not block.

    Attributes:
        running: running controllers, in the order of their start, which is that of their updates.
        time: robot time of the last cycle [s].
        cycles: number of cycles so far.
        mode_changed: True if the last cycle called the robot's `do_switch`, or the robot is not ready yet after it.
        updating: True during a cycle.
    """

    def __init__(self, robot_hw: RobotHW, report: Callable[[str], None]) -> None:
        self._hw, self._report = robot_hw, report
        self.running: tuple[LoadedController, ...] = ()
        self.time, self.cycles = 0.0, 0
        self.mode_changed = self.updating = False
        self._switching = False  # checked in each cycle: a request is pending, or `mode_changed` must be reset
        self._request: SwitchRequest | None = None
        self._tick_at, self._tick_period = math.inf, math.inf
        self._tick: Callable[[float], None] | None = None

    def update(self, time: float, period: float, reset_controllers: bool = False) -> None:
        """Run one cycle: execute a pending switch request, then update every running controller.

        Args:
            time: robot time [s].
            period: time since the last cycle [s].
            reset_controllers: True to stop and start the running controllers first, as the robot was reset or
                re-entered its command mode.
        """
        self.updating = True
        self.time = time
        self.cycles += 1
        if reset_controllers:
            self._restart(time)
        if self._switching:
            self._switch(time)
        for entry in self.running:
            begin = perf_counter()
            try:
                entry.update(time, period)
            except BaseException as error:  # one controller's failure must neither stop the others nor end the run
                pass_ctrl_c(error)
                self._abort(entry, time, "update", error)
                continue
            # Welford's running mean and sum of squares, inline: this runs a thousand times a second for each
            # controller.
            spent = perf_counter() - begin
            entry.updates += 1
            delta = spent - entry.mean_time
            entry.mean_time += delta / entry.updates
            entry.squares += delta * (spent - entry.mean_time)
            if spent > entry.max_time:
                entry.max_time = spent
            if spent > period:
                entry.overruns += 1
                entry.last_overrun = time
        if time >= self._tick_at and self._tick is not None:
            self._tick_at = time + self._tick_period
            self._tick(time)
        self.updating = False

    def call_periodically(self, period: float, tick: Callable[[float], None] | None) -> None:
        """Let the loop call `tick(time)` every `period` seconds of robot time; None: no more."""
        self._tick, self._tick_period = tick, period
        self._tick_at = self.time if tick is not None else math.inf

    def hand_over(self, request: SwitchRequest) -> None:
        """Pass a switch request to the loop; called from another thread."""
        self._request = request
        self._switching = True

    def withdraw(self, request: SwitchRequest) -> None:
        """Remove a cancelled switch request, and abort the controllers that wait to be started by it."""
        if self._request is request:
            self._request = None
        for entry in request.waiting:
            entry.abort("the switch that was to start it was cancelled")

    def apply(self, request: SwitchRequest, time: float) -> None:
        """Execute a switch request now: if no loop is running, or from the loop's own thread between two cycles."""
        self.hand_over(request)
        self._switch(time)

    def release(self, entry: LoadedController) -> None:
        """Stop a controller without calling the robot's `do_switch`; used after the loop has ended."""
        self._stop(entry, self.time)

    def _switch(self, time: float) -> None:
        request = self._request
        if request is None:
            self._switching = self.mode_changed = False
            return
        if request.begun_at is None and not self._begin(request, time):
            self._request = None
            return
        self._start_ready(request, time)
        if not request.waiting:
            request.finish.acquire(blocking=False)
            self._request = None
            request.done.set()

    def _begin(self, request: SwitchRequest, time: float) -> bool:
        if not request.begin.acquire(blocking=False):  # the requesting thread has cancelled it
            return False
        request.begun_at = time
        for entry in request.plan.stop:
            if entry.running:  # the controller may have been aborted since the request was checked
                self._stop(entry, time)
        self.mode_changed = True
        try:
            self._hw.do_switch(
                [entry.info for entry in request.plan.start], [entry.info for entry in request.plan.stop]
            )
        except BaseException as error:  # becomes the error of the switch
            pass_ctrl_c(error)
            why = f"the robot could not switch: {describe(error)}"
            request.failures.append(why)
            for entry in request.plan.start:
                entry.abort(why)
        else:
            request.waiting.extend(request.plan.start)
        return True

    def _start_ready(self, request: SwitchRequest, time: float) -> None:
        waiting = request.waiting
        groups = [[entry] for entry in waiting] if request.start_asap else [list(waiting)]
        for group in groups:
            try:
                ready = self._hw.switch_done([entry.info for entry in group])
            except BaseException as error:  # becomes the error of the switch
                pass_ctrl_c(error)
                self._give_up(request, group, f"the robot could not switch: {describe(error)}")
                continue
            if ready:
                if len(group) == len(waiting) and not request.finish.acquire(blocking=False):
                    self._give_up(request, group, "the request was cancelled")
                    continue
                for entry in group:
                    waiting.remove(entry)
                    self._start(entry, time, request.failures)
            elif request.timeout > 0.0 and time - (request.begun_at or 0.0) > request.timeout:
                self._give_up(request, group, f"the robot was not ready within {request.timeout:g} s")
            else:
                self.mode_changed = True
                for entry in group:
                    entry.state = ControllerState.WAITING

    def _give_up(self, request: SwitchRequest, group: list[LoadedController], reason: str) -> None:
        self._release(group)
        for entry in group:
            request.waiting.remove(entry)
            entry.abort(f"it was not started: {reason}")
            request.failures.append(f"{entry.name} was not started: {reason}")

    def _start(self, entry: LoadedController, time: float, failures: list[str]) -> None:
        entry.clear_statistics()
        try:
            entry.controller.starting(time)
        except BaseException as error:  # becomes the error of the switch and is reported; the others go on
            pass_ctrl_c(error)
            self._abort(entry, time, "starting", error)
            failures.append(f"{entry.name} failed in starting: {describe(error)}")
            return
        entry.state = ControllerState.RUNNING
        self.running = (*self.running, entry)

    def _stop(self, entry: LoadedController, time: float) -> None:
        self.running = tuple(other for other in self.running if other is not entry)
        entry.state = ControllerState.STOPPED
        self._call_stopping(entry, time)

    def _call_stopping(self, entry: LoadedController, time: float) -> None:
        try:
            entry.controller.stopping(time)
        except BaseException as error:  # the controller is stopped in any case
            pass_ctrl_c(error)
            self._report(f"controller {entry.name} failed in stopping: {describe(error)}")

    def _restart(self, time: float) -> None:
        for entry in self.running:
            try:
                entry.controller.stopping(time)
                entry.controller.starting(time)
            except BaseException as error:  # one controller's failure must not stop the others
                pass_ctrl_c(error)
                self._abort(entry, time, "restarting", error)

    def _abort(self, entry: LoadedController, time: float, where: str, error: BaseException) -> None:
        self.running = tuple(other for other in self.running if other is not entry)
        entry.abort(f"it failed in {where}: {describe(error)}")
        self._report(f"controller {entry.name} is aborted, {entry.error}")
        self._call_stopping(entry, time)
        self._release([entry])

    def _release(self, entries: Sequence[LoadedController]) -> None:
        """Release the joints of controllers that do not run, although `do_switch` was called to start them."""
        self._switching = self.mode_changed = True
        try:
            self._hw.do_switch([], [entry.info for entry in entries])
        except BaseException as failure:  # the manager has released the joints; `run` of the robot reports its state
            names = ", ".join(entry.name for entry in entries)
            self._report(f"the robot could not release the joints of controller {names}: {describe(failure)}")
