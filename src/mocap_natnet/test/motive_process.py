"""The emulated Motive as a process of its own, on ports that are free."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator


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
