"""Rules for switching controllers, and the switch request that is passed to the control loop."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hric_control.manager.loaded_controller import LoadedController
from hric_core.errors import HricError, UnknownNameError

BEST_EFFORT = 1
"""Strictness of a switch request that omits the controllers which cannot be switched."""
STRICT = 2
"""Strictness of a switch request that is refused as a whole if one controller cannot be switched."""


@dataclass(frozen=True)
class SwitchPlan:
    """Controllers that a switch request starts and stops.

    Attributes:
        start, stop: controllers to start and to stop, in the order of the request.
        skipped: reasons why controllers were omitted (BEST_EFFORT), one text for each.
    """

    start: tuple[LoadedController, ...]
    stop: tuple[LoadedController, ...]
    skipped: tuple[str, ...]


def plan_switch(
    loaded: Mapping[str, LoadedController], start: Sequence[str], stop: Sequence[str], strictness: int
) -> SwitchPlan:
    """Apply the rules of ros_control's switch_controller and return the plan.

    Raises:
        HricError: the request is refused; the message names the controller and the reason.
    """
    skipped: list[str] = []

    def fault(error: HricError) -> None:
        if strictness == STRICT:
            raise error
        skipped.append(str(error))

    both = [name for name in start if name in stop and name in loaded and loaded[name].running]
    if both:
        raise HricError(f"{', '.join(both)} is running and named both to start and to stop; request one of them")
    to_stop, to_start = [], []
    for name in dict.fromkeys(stop):
        if name not in loaded:
            fault(UnknownNameError("controller", name, loaded, "the manager, to stop"))
        elif not loaded[name].running:
            fault(HricError(f"controller {name} cannot be stopped: it is {loaded[name].state.value}, not running"))
        else:
            to_stop.append(loaded[name])
    for name in dict.fromkeys(start):
        if name not in loaded:
            fault(UnknownNameError("controller", name, loaded, "the manager, to start (load it first)"))
        elif loaded[name].running:
            fault(HricError(f"controller {name} cannot be started: it is running already"))
        else:
            to_start.append(loaded[name])
    return SwitchPlan(tuple(to_start), tuple(to_stop), tuple(skipped))


@dataclass
class SwitchRequest:
    """Switch request that is passed to the control loop, with the state of its execution.

    Attributes:
        plan: controllers to start and stop.
        start_asap: True to start each controller as soon as the robot is ready for it, not all together.
        timeout: longest wait for the robot to be ready [s of robot time]; 0: no limit.
        begin, finish: locks that are acquired only once, without waiting, either by the loop that executes the request
            or by the caller who cancels it. So a request is executed or cancelled, never both.
        begun_at: robot time at which the robot's mode was switched [s]; None before.
        waiting: controllers that wait for the robot to be ready.
        failures: texts of the errors in the loop.
        done: event that the loop sets when the request is finished.
    """

    plan: SwitchPlan
    start_asap: bool = False
    timeout: float = 0.0
    begin: threading.Lock = field(default_factory=threading.Lock)
    finish: threading.Lock = field(default_factory=threading.Lock)
    begun_at: float | None = None
    waiting: list[LoadedController] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    done: threading.Event = field(default_factory=threading.Event)
