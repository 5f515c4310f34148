"""Controller manager with the life cycle and the rules of ros_control: loads, switches and lists controllers."""

import contextlib
import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from hric_control.controller import Controller
from hric_control.manager.loaded_controller import ControllerStatus, LoadedController, UpdateStatistics
from hric_control.manager.loop import ManagerLoop, describe, pass_ctrl_c
from hric_control.manager.switching import BEST_EFFORT, STRICT, SwitchPlan, SwitchRequest, plan_switch
from hric_control.robot_hw import ControllerInfo, RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_core import plugins, realtime
from hric_core.errors import HricError, ParameterError, check_known, message_about
from hric_core.node import Node
from hric_core.scoped_node import ScopedNode

LOOP_TIMEOUT = 2.0
"""Longest wait for the control loop to begin a requested switch of controllers [s of wall time]."""


def import_controllers(root_node: Node) -> list[str]:
    """Import the modules of all controllers configured in the robot's namespace.

    So the control loop is not delayed by an import when a controller is loaded later.

    Returns:
        the imported controller types. A type that cannot be imported is logged; `load` will refuse it.
    """
    everything = root_node.param(root_node.namespace, {})
    exported = plugins.names(plugins.CONTROLLER)
    configured = (
        {value.get("type") for value in everything.values() if isinstance(value, dict)}
        if isinstance(everything, dict)
        else set()
    )
    done = []
    for name in sorted(kind for kind in configured if isinstance(kind, str) and kind in exported):
        try:
            plugins.find(plugins.CONTROLLER, name)
            done.append(name)
        except HricError as error:
            root_node.log_error(str(error))
    return done


class ControllerManager:
    """Manager of one robot's controllers.

    The control loop calls `update`; all other methods may be called from any other thread.

    Args:
        robot_hw: the robot, initialised.
        root_node: node of the robot's namespace; a controller's parameters are in `<root>/<name>/`.
        classes: additional controller classes by type string, which no package exports, for scripts and tests; they
            take precedence.

    Attributes:
        loop_running: True if the control loop executes a `switch`; False if the calling thread does so at once (before
            a run without ROS begins).
        loop_timeout: longest wait for the loop to begin a switch [s of wall time].
    """

    def __init__(
        self, robot_hw: RobotHW, root_node: Node, classes: Mapping[str, type[Controller]] | None = None
    ) -> None:
        self.loop_running = True
        self.loop_timeout = LOOP_TIMEOUT
        self._hw, self._node = robot_hw, root_node
        self._classes = dict(classes or {})
        self._loaded: dict[str, LoadedController] = {}
        self._lock = threading.RLock()
        self._others: list[ControllerManager] = []
        self._loop_thread: int | None = None
        self._loop = ManagerLoop(
            robot_hw, lambda text: realtime.defer(root_node, lambda: root_node.log_error(text), "log")
        )
        self.update: Callable[..., None] = self._first_update
        """Run one cycle, from the loop: `update(time, period, reset_controllers=False)`, both times in seconds."""

    def _first_update(self, time: float, period: float, reset_controllers: bool = False) -> None:
        # The first cycle identifies the loop's thread; later cycles call the loop's method directly.
        self._loop_thread = threading.get_ident()
        self.update = self._loop.update
        self._loop.update(time, period, reset_controllers)

    def share_robots(self, managers: Sequence["ControllerManager"]) -> None:
        """Refuse conflicts with running controllers of other managers that command the same robots, and vice versa.

        All these managers execute one request at a time. Call it before the first request.
        """
        for manager in managers:
            manager._lock = self._lock
            manager._others.append(self)
            self._others.append(manager)

    @property
    def switch_pending(self) -> bool:
        """True if the last `update` called the robot's `do_switch`, or if the robot is not ready yet after a switch.

        In that case `on_cycle` returns False, so that the robot leaves its command mode in the same cycle. The run is
        not ended by it."""
        return self._loop.mode_changed

    def load(self, name: str) -> None:
        """Construct and initialise the controller that is configured in the namespace `<root>/<name>`.

        Raises:
            HricError: the controller is loaded already, has no type or an unknown one, its `init` failed, or a
                parameter is set that its `init` does not read.
        """
        with self._exclusive():
            if name in self._loaded:
                raise HricError(f"controller {name} is loaded already")
            self._loaded[name] = self._create(name)

    def unload(self, name: str) -> None:
        """Shut down a controller and remove it.

        Raises:
            HricError: the controller is not loaded, or is running.
        """
        with self._exclusive():
            check_known("controller", [name], self._loaded, "the manager, to unload")
            if self._loaded[name].running:
                raise HricError(f"controller {name} cannot be unloaded: it is running; stop it first")
            self._dispose(self._loaded.pop(name))

    def switch(
        self,
        start: Sequence[str],
        stop: Sequence[str],
        strictness: int = STRICT,
        start_asap: bool = False,
        timeout: float = 0.0,
        *,
        loop_running: bool | None = None,
    ) -> None:
        """Stop and start controllers within one control cycle; return when this is done.

        Args:
            start: names of loaded controllers to start.
            stop: names of loaded controllers to stop.
            strictness: STRICT refuses the whole request if one controller cannot be switched, BEST_EFFORT omits such
                controllers.
            start_asap: True to start each controller as soon as the robot is ready for it, False to start all together.
            timeout: longest time until the robot is ready [s of robot time]; 0: no limit.
            loop_running: False to execute the switch in the calling thread, as no loop is running; by default the
                attribute `loop_running`.

        Raises:
            HricError: the request is refused; the message gives the reason, and for a conflict over a joint both
                controllers.
        """
        if not (math.isfinite(timeout) and timeout >= 0.0):
            raise HricError(f"timeout of a switch must be 0 (no limit) or a positive number of seconds, not {timeout}")
        with self._exclusive():
            plan = plan_switch(self._loaded, start, stop, self._strictness(strictness))
            for text in plan.skipped:
                self._node.log_warn(f"switch of controllers: omitted: {text}")
            if not plan.start and not plan.stop:
                return
            self._check(plan)
            request = SwitchRequest(plan, start_asap, timeout)
            self._carry_out(request, self.loop_running if loop_running is None else loop_running)
            if request.failures:
                raise HricError("; ".join(request.failures))

    def reload(self, force_kill: bool = False) -> None:
        """Reload the Python modules of the controllers.

        Args:
            force_kill: True to stop and unload all controllers first.

        Raises:
            HricError: controllers are loaded and `force_kill` is False, or a module cannot be loaded.
        """
        with self._exclusive():
            if self._loaded and not force_kill:
                raise HricError(f"controllers are loaded ({', '.join(self._loaded)}): unload them, or set force_kill")
            self.switch([], [entry.name for entry in self._loaded.values() if entry.running])
            for name in list(self._loaded):
                self.unload(name)
            plugins.reload(plugins.CONTROLLER)

    def list(self) -> list[ControllerStatus]:
        """Return the status of all loaded controllers, in the order of loading."""
        return [entry.status() for entry in tuple(self._loaded.values())]

    def types(self) -> dict[str, str]:
        """Return the name of the base class of each controller type that can be loaded, by type string."""
        return dict.fromkeys(sorted({*self._classes, *plugins.names(plugins.CONTROLLER)}), plugins.CONTROLLER)

    def statistics(self) -> Sequence[UpdateStatistics]:
        """Return statistics of the durations of the controllers' updates."""
        return [entry.statistics() for entry in tuple(self._loaded.values())]

    def call_periodically(self, period: float, tick: Callable[[float], None] | None) -> None:
        """Let the loop call `tick(time)` every `period` seconds of robot time; None: no more. `tick` must not block."""
        self._loop.call_periodically(period, tick)

    def shutdown(self) -> None:
        """Stop and unload all controllers; to be called after the loop has ended."""
        with self._lock:
            for entry in reversed(self._loop.running):
                self._loop.release(entry)
            while self._loaded:
                self._dispose(self._loaded.popitem()[1])

    @contextlib.contextmanager
    def _exclusive(self) -> Iterator[None]:
        """Execute one request at a time; raise HricError in the loop's thread if another request is being executed.

        The loop's thread must not wait for a request that in turn waits for the loop."""
        in_loop = threading.get_ident() == self._loop_thread
        if not self._lock.acquire(blocking=not in_loop):
            raise HricError("the controller manager is executing another request; try again")
        try:
            yield
        finally:
            self._lock.release()

    def _strictness(self, strictness: int) -> int:
        if strictness in (BEST_EFFORT, STRICT):
            return strictness
        if strictness != 0:
            raise HricError(f"strictness must be {BEST_EFFORT} (BEST_EFFORT) or {STRICT} (STRICT), not {strictness}")
        self._node.log_warn(
            f"switch of controllers: strictness is not set, BEST_EFFORT is used; set it to {BEST_EFFORT} (BEST_EFFORT) "
            f"or {STRICT} (STRICT)"
        )
        return BEST_EFFORT

    def _check(self, plan: SwitchPlan) -> None:
        stay = [entry.info for entry in self._loop.running if entry not in plan.stop]
        start = [entry.info for entry in plan.start]
        others = [info for manager in self._others for info in manager._running_elsewhere()]
        self._hw.check_for_conflict([*others, *stay, *start])
        self._hw.prepare_switch(start, [entry.info for entry in plan.stop])

    def _running_elsewhere(self) -> Sequence[ControllerInfo]:
        """Return the running controllers under their full names, as another manager may have the same short names."""
        return [replace(entry.info, name=self._node.resolve(entry.name)) for entry in self._loop.running]

    def _carry_out(self, request: SwitchRequest, loop_running: bool) -> None:
        if self._loop_thread == threading.get_ident():
            if self._loop.updating:
                raise HricError("controllers cannot be switched from within a controller's update")
            self._loop.apply(request, self._loop.time)
        elif loop_running:
            self._wait_for_loop(request)
        else:
            self._hw.read(self._loop.time, 0.0)  # so that a starting controller reads the present state
            self._loop.apply(request, self._loop.time)
            if request.waiting:
                self._loop.withdraw(request)
                raise HricError(
                    f"the robot is not ready to start {', '.join(entry.name for entry in request.waiting)}, and no "
                    "control loop is running that could wait for it"
                )

    def _wait_for_loop(self, request: SwitchRequest) -> None:
        self._loop.hand_over(request)
        if not request.done.wait(self.loop_timeout) and request.begin.acquire(blocking=False):
            self._loop.withdraw(request)
            raise HricError(
                f"the control loop is not running (paused?): the switch was cancelled after {self.loop_timeout:g} s; "
                "nothing was changed"
            )
        cycles = self._loop.cycles
        while not request.done.wait(self.loop_timeout):
            if self._loop.cycles == cycles and request.finish.acquire(blocking=False):
                self._loop.withdraw(request)
                raise HricError(
                    "the control loop stopped while the robot was switching; the controllers that were to start are "
                    "aborted"
                )
            cycles = self._loop.cycles

    def _create(self, name: str) -> LoadedController:
        scope, named = ScopedNode(self._node.child(name)), self._node.resolve(name).lstrip("/")
        kind = scope.param("type", None)
        if not isinstance(kind, str) or not kind:
            raise ParameterError(
                f"controller {name} has no type: set the parameter {scope.resolve('type')} (is its configuration "
                "loaded?)"
            )
        controller_class = self._classes.get(kind) or plugins.find(plugins.CONTROLLER, kind)
        for interface in self._hw.interfaces():
            interface.clear_claims()
        try:
            controller: Controller = controller_class()
            controller.init(self._hw, scope.also(self._node), scope)
        except BaseException as error:
            scope.close()
            pass_ctrl_c(error)
            raise HricError(f"controller {named} cannot be loaded: {describe(error)}") from error
        claims = {interface.cpp_name: interface.claims for interface in self._hw.interfaces() if interface.claims}
        obeys = self._hw.get(SpeedScaleInterface).declared
        entry = LoadedController(controller, ControllerInfo(name, kind, claims), scope, obeys)
        try:
            scope.refuse_unread()
        except HricError as error:
            self._dispose(entry)
            raise HricError(message_about(f"controller {named} cannot be loaded", error)) from error
        return entry

    def _dispose(self, entry: LoadedController) -> None:
        try:
            entry.controller.shutdown()
        except BaseException as error:  # the controller is unloaded in any case
            pass_ctrl_c(error)
            self._node.log_error(f"controller {entry.name} failed in shutdown: {describe(error)}")
        entry.scope.close()
