"""Fixtures for tests that need a real master. In a conftest.py: `from real_master import ros, roscore`."""

import atexit
import contextlib
import functools
import os
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from typing import Any

import pytest

from hric_core.processes import end_process

START_TIMEOUT = 20.0
"""Longest start of a roscore on a busy machine [s]."""
END_TIMEOUT = 30.0
"""Longest end of nodes on a busy machine [s]."""


PORTS = range(20_000, 32_000)
"""Ports below Linux's ephemeral range, from 32768 on (net.ipv4.ip_local_port_range), so that they stay free."""
_given: set[int] = set()


def free_port() -> int:
    """Return a port without TCP or UDP listener; a different one at each call."""
    while True:
        port = random.SystemRandom().choice(PORTS)
        if port not in _given and all(map(functools.partial(_is_free, port), (socket.SOCK_STREAM, socket.SOCK_DGRAM))):
            _given.add(port)
            return port


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with contextlib.closing(socket.socket(socket.AF_INET, kind)) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


@functools.lru_cache(maxsize=1)
def start_roscore() -> str:
    """Start a roscore for this process, once, and point the environment to it. It ends with the process.

    Returns:
        the URI of the master.
    """
    import rosgraph

    port = free_port()
    logs = tempfile.mkdtemp(prefix="hric_test_ros_")
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", ROS_LOG_DIR=logs, ROS_HOME=logs)
    os.environ.pop("ROS_HOSTNAME", None)
    process = subprocess.Popen(
        ["roscore", "-p", str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    atexit.register(shutil.rmtree, logs, ignore_errors=True)
    atexit.register(end_process, process, 5.0)  # runs first, as it is registered last
    deadline = time.monotonic() + START_TIMEOUT
    while not rosgraph.is_master_online():
        if process.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"roscore on port {port} did not start (exit code {process.poll()})")
        time.sleep(0.05)
    return os.environ["ROS_MASTER_URI"]


@pytest.fixture(scope="session")
def roscore() -> Iterator[str]:
    """Yield the URI of a master on its own port; ROS_MASTER_URI points to it."""
    yield start_roscore()


@pytest.fixture(scope="session")
def ros(roscore: str) -> Iterator[str]:
    """Initialise the test process as a rospy node, possible only once per process, and yield the node's name."""
    import rospy

    if not rospy.core.is_initialized():
        rospy.init_node("pytest", anonymous=True, disable_signals=True)
    yield rospy.get_name()


def end_nodes(*processes: subprocess.Popen[Any]) -> list[Any]:
    """Interrupt running nodes, and kill those that do not end.

    A killed node stays registered; when a node of its name starts again, the master shuts down the process that owns
    its port by then.

    Returns:
        unread output of each; None if the output is not piped.
    """
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    return [_last_words(process) for process in processes]


def _last_words(process: subprocess.Popen[Any]) -> Any:
    try:
        return process.communicate(timeout=END_TIMEOUT)[0]
    except subprocess.TimeoutExpired:
        process.kill()
        return process.communicate()[0]
