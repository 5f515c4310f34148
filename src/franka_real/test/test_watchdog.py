"""An arm that cannot be reached is reported in time, and a process that hangs is ended."""

import os
import socket
import subprocess
import sys
import time

import pytest
from cost_ratio import cost_ratio

from franka_real import probe
from franka_real.backend import ArmLostError
from franka_real.watchdog import Watchdog

pytestmark = pytest.mark.alone

PROGRAM = """
import sys, time
from franka_real.watchdog import Watchdog
watchdog = Watchdog(0.3, 1.2, "the arm")
print(watchdog.pid, flush=True)
watchdog.arm()
for _ in range(40):
    watchdog.beat()
    time.sleep(0.01)
with watchdog.patiently():
    time.sleep(0.6)
print("patient", flush=True)
exec(sys.argv[1])
print("not ended", flush=True)
"""


def run(end: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", PROGRAM, end], capture_output=True, text=True, timeout=30.0)


def alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_loop_that_hangs_with_the_interpreters_lock_is_ended_with_a_word() -> None:
    # sleep of the C library through PyDLL keeps the lock, as libfranka's bindings do.
    done = run("import ctypes; ctypes.PyDLL(None).sleep(20)")
    assert done.returncode == -9
    assert done.stdout.split()[1:] == ["patient"]
    assert "[FATAL] the arm has not responded for 0.3 s" in done.stderr


@pytest.mark.parametrize("end", ["watchdog.disarm(); time.sleep(0.8)", "watchdog.close(); time.sleep(0.5)"])
def test_who_is_not_watched_may_stand_still(end) -> None:
    done = run(end)
    assert (done.returncode, done.stderr) == (0, "")
    assert "not ended" in done.stdout


def test_the_watchdog_ends_with_its_process_however_that_ends() -> None:
    done = run("import os; os._exit(3)")
    assert done.returncode == 3
    deadline = time.monotonic() + 30.0
    while alive(int(done.stdout.split()[0])):
        assert time.monotonic() < deadline, "the watchdog outlives its process"
        time.sleep(0.02)


def test_a_beat_is_cheap() -> None:
    watchdog = Watchdog(60.0, 60.0, "the arm")
    try:
        watchdog.arm()
        ratio = cost_ratio(watchdog.beat, lambda: [0.0] * 7, times=1000)  # what one list of the cycle costs
    finally:
        watchdog.close()
    assert ratio < 20.0


def test_the_probe_finds_who_listens_and_leaves_nothing_open() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        probe.check("127.0.0.1", 1.0, server.getsockname()[1])
        connection, _ = server.accept()
        with connection:
            assert connection.recv(1) == b""


def test_the_probe_gives_up_after_its_time_where_nobody_responds() -> None:
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        port = server.getsockname()[1]
        waiting = []
        try:
            for _ in range(3):  # nobody accepts: the queue is full, and further connections wait
                client = socket.socket()
                client.setblocking(False)
                client.connect_ex(("127.0.0.1", port))
                waiting.append(client)
            with pytest.raises(ArmLostError, match=r"no response within 0.3 s\. Is robot_ip right"):
                probe.check("127.0.0.1", 0.3, port)
        finally:
            for client in waiting:
                client.close()
