"""The emulated Motive as a process of its own, on ports that are free."""

import contextlib
import socket
import subprocess
import sys
from collections.abc import Iterator


def free_port() -> int:
    """A UDP port that nobody listens on now."""
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.contextmanager
def motive(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The command with these arguments, once it stands."""
    process = subprocess.Popen(
        [sys.executable, "-m", "mocap_natnet.server", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stderr is not None
        line = process.stderr.readline()
        assert "bitstream" in line, line
        yield process
    finally:
        process.terminate()
        process.wait(10)
        process.stderr.close()
