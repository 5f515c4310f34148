"""The emulated Motive as a separate process, on free ports."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator


@contextlib.contextmanager
def motive(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start the command with arguments, and return once it streams."""
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
