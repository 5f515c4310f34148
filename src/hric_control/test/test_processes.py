"""The control loop's thread has a higher priority, where that is allowed."""

import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from hric_control import processes


def test_only_the_calling_thread_gets_the_priority() -> None:
    def nice() -> int:
        return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    mine = nice()

    def prefer() -> tuple[bool, int, int]:
        allowed = processes.prefer_this_thread()
        with ThreadPoolExecutor(1) as started:
            return allowed, nice(), started.submit(nice).result()

    with ThreadPoolExecutor(1) as pool:
        allowed, its, of_one_it_started = pool.submit(prefer).result()
    assert its == (processes.NICE if allowed else mine)
    assert of_one_it_started == nice() == mine


def test_it_returns_false_where_it_is_not_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: int) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "setpriority", refuse)
    assert not processes.prefer_this_thread()


def test_a_process_that_ignores_the_interrupt_is_killed_with_its_group() -> None:
    program = (
        "import signal, time; signal.signal(signal.SIGINT, signal.SIG_IGN); print('ready', flush=True); time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, start_new_session=True)
    assert process.stdout is not None and process.stdout.readline() == b"ready\n"
    processes.end_process(process, 0.2)
    assert process.returncode == -signal.SIGKILL
    processes.end_process(process, 0.2)  # which has ended
