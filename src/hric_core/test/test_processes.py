"""The control loop's thread has a higher priority, where that is allowed."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from hric_core import processes
from hric_core.errors import FailureError, HricError, ParameterError, failing
from hric_core.processes import UNREAD_CODE, run_command


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
    assert of_one_it_started == (0 if allowed else mine), "the system gives it the normal priority"
    assert nice() == mine


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


def test_what_ends_later_than_the_process_that_started_it_is_waited_for() -> None:
    slow = (
        "import signal, time; print(flush=True); signal.sigwait({signal.SIGINT}); time.sleep(0.3); "
        "print('done', flush=True)"
    )
    hasty = f"""
import signal, subprocess, sys
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
child = subprocess.Popen([sys.executable, "-c", {slow!r}])
signal.sigwait([signal.SIGINT])
child.send_signal(signal.SIGINT)
"""
    with subprocess.Popen([sys.executable, "-c", hasty], start_new_session=True, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline() == b"\n"
        processes.end_process(process, 10.0)
        with pytest.raises(ProcessLookupError):
            os.killpg(process.pid, 0)
        assert process.stdout.read() == b"done\n"


def interrupted() -> None:
    raise KeyboardInterrupt


def refused(error: HricError, begun: bool = False) -> int:
    """Exit code of a command whose work raises the error, before or after it has begun."""

    def work() -> None:
        with failing() if begun else contextlib.nullcontext():
            raise error

    return processes.run_command("tool", work)


def test_a_command_returns_2_for_a_mistake_and_1_for_a_failure(capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(ParameterError("kp is -1; valid: 0 or more")) == 2
    assert refused(FailureError("no robot")) == 1
    assert capsys.readouterr().err == "tool: kp is -1; valid: 0 or more\ntool: no robot\n"


def test_what_goes_wrong_once_a_command_has_begun_is_a_failure_whatever_its_type() -> None:
    assert refused(ParameterError("kp is -1"), begun=True) == 1
    assert ParameterError("kp is -1").exit_code == 2


def test_a_command_returns_what_its_work_does_and_130_after_ctrl_c() -> None:
    assert processes.run_command("tool", lambda: None) == 0
    assert processes.run_command("tool", lambda: 3) == 3
    assert processes.run_command("tool", interrupted) == 130
    assert processes.run_command("tool", interrupted, interrupted=0) == 0


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_command_whose_output_nobody_reads_any_more_ends_without_a_word(unbuffered: str) -> None:
    code = (
        "from hric_core.processes import run_command\n"
        "raise SystemExit(run_command('x', lambda: [print('line') for _ in range(100_000)] and None))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
    )
    assert process.stdout is not None and process.stderr is not None
    assert process.stdout.readline() == b"line\n"
    process.stdout.close()
    assert (process.wait(60), process.stderr.read()) == (UNREAD_CODE, b"")


def test_a_broken_pipe_that_is_not_the_output_is_no_quiet_end() -> None:
    def work() -> None:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        run_command("x", work)
