"""Real-time measures for the control loop: priority, locked memory, thread switching, garbage collection."""

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
"""Constants of Linux's sys/mman.h."""


@dataclass(frozen=True)
class Measure:
    """Result of one real-time measure. done: True if it took effect; text: what was done, or why it was not."""

    done: bool
    text: str


def take_priority(priority: int) -> Measure:
    """Set the real-time priority of the calling thread: SCHED_FIFO 1 to 98; 0: ordinary scheduling.

    Called again after libfranka has started its loop, since libfranka sets SCHED_FIFO 99 if permitted.
    """
    try:
        if priority == 0:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            return Measure(True, "ordinary scheduling, as requested")
        # Threads and processes that the loop's thread starts must not inherit it.
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except PermissionError:
        return Measure(
            False,
            "no real-time priority: the limit rtprio forbids it (see hric check_workstation)",
        )
    return Measure(True, f"SCHED_FIFO {priority}")


@contextmanager
def priority_kept() -> Iterator[None]:
    """Restore the calling thread's scheduling at the end of a context in which libfranka may change it."""
    scheduler, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        if (os.sched_getscheduler(0), os.sched_getparam(0).sched_priority) != (scheduler, parameters.sched_priority):
            with suppress(PermissionError):
                os.sched_setscheduler(0, scheduler, parameters)


def _lock() -> Measure:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0:
        return Measure(True, "memory locked")
    return Measure(False, f"memory not locked: {os.strerror(ctypes.get_errno())} (limit memlock)")


@contextmanager
def realtime(priority: int, lock_memory: bool, switch_interval: float) -> Iterator[list[Measure]]:
    """Apply the real-time measures to the calling thread and its process, and undo them at the end.

    Args:
        priority: SCHED_FIFO priority of the thread, 1 to 98; 0: ordinary scheduling.
        lock_memory: True: lock the memory of the process, so that it is not paged out.
        switch_interval: maximum time for which another thread may hold the interpreter [s].

    Yields:
        Results of the measures.
    """
    interval = sys.getswitchinterval()
    measures = [take_priority(priority)]
    if lock_memory:
        measures.append(_lock())
    sys.setswitchinterval(switch_interval)
    measures.append(Measure(True, f"switch interval {1e3 * switch_interval:g} ms"))
    frozen = gc.get_freeze_count()  # by the program itself, which `unfreeze` would undo
    gc.collect()
    if not frozen:
        gc.freeze()
    measures.append(Measure(True, f"{frozen or gc.get_freeze_count()} objects excluded from garbage collection"))
    try:
        yield measures
    finally:
        if not frozen:
            gc.unfreeze()
        sys.setswitchinterval(interval)
        if lock_memory:
            ctypes.CDLL(None).munlockall()
