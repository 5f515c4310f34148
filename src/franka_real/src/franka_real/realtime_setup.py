"""Measures that Python offers for a loop that must not be late; each measure reports its result."""

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
    """Result of one measure: what was done, or the reason why it was not possible."""

    done: bool
    text: str


def take_priority(priority: int) -> Measure:
    """Set the calling thread's scheduling, also after libfranka, which takes SCHED_FIFO 99 where it may."""
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
    """Restore the calling thread's scheduling after a call that may change it."""
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
    """Apply the measures to the calling thread and its process, and undo them at the end.

    Args:
        priority: SCHED_FIFO priority of the thread, 1 to 98; 0: ordinary scheduling.
        lock_memory: True: the process is not paged out.
        switch_interval: maximum time for which another thread may hold the interpreter [s].

    Yields:
        the results of the measures.
    """
    interval = sys.getswitchinterval()
    measures = [take_priority(priority)]
    if lock_memory:
        measures.append(_lock())
    sys.setswitchinterval(switch_interval)
    measures.append(Measure(True, f"switch interval {1e3 * switch_interval:g} ms"))
    gc.collect()
    gc.freeze()
    measures.append(Measure(True, f"{gc.get_freeze_count()} objects out of the garbage collector's sight"))
    try:
        yield measures
    finally:
        gc.unfreeze()
        sys.setswitchinterval(interval)
        if lock_memory:
            ctypes.CDLL(None).munlockall()
