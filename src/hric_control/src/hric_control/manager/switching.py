"""Rules of a switch request, and the request that is passed to the loop."""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hric_control.manager.loaded_controller import LoadedController
from hric_core.errors import HricError, UnknownNameError

BEST_EFFORT = 1
"""Strictness that skips names that cannot be switched."""
STRICT = 2
"""Strictness that refuses the whole request if one name cannot be switched."""


@dataclass(frozen=True)
class SwitchPlan:
    """Controllers that a request starts and stops.

    Attributes:
        start, stop: controllers to start and to stop, in the order of the request.
        skipped: reasons why names were left out (BEST_EFFORT).
    """

    start: tuple[LoadedController, ...]
    stop: tuple[LoadedController, ...]
    skipped: tuple[str, ...]


def plan_switch(
    loaded: Mapping[str, LoadedController], start: Sequence[str], stop: Sequence[str], strictness: int
) -> SwitchPlan:
    """Apply the rules of ros_control's switch_controller and return the plan.

    Raises:
        HricError: the request is refused; says which name and why.
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
            fault(HricError(f"{name} cannot be stopped: it is {loaded[name].state.value}, not running"))
        else:
            to_stop.append(loaded[name])
    for name in dict.fromkeys(start):
        if name not in loaded:
            fault(UnknownNameError("controller", name, loaded, "the manager, to start (load it first)"))
        elif loaded[name].running:
            fault(HricError(f"{name} cannot be started: it is running already"))
        else:
            to_start.append(loaded[name])
    return SwitchPlan(tuple(to_start), tuple(to_stop), tuple(skipped))


@dataclass
class SwitchRequest:
    """Planned switch on its way through the loop.

    Attributes:
        plan: controllers to start and stop.
        start_asap: start each controller as soon as the hardware is ready for it, not all together.
        timeout: longest wait for the hardware [s of robot time]; 0 = for ever.
        begin, finish: acquired once, without waiting, by the loop that acts or by the caller who gives up. So a request
            is carried out or cancelled, never both.
        begun_at: robot time at which the hardware was switched [s]; None before.
        waiting: controllers that wait for the hardware.
        failures: errors in the loop.
        done: set by the loop when the request is finished.
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
