"""An emulated controller in a process of its own, as ur_rtde's constructors hold the interpreter."""

import subprocess
import time
from collections.abc import Iterator

import pytest
from fci_peer import new_address

from ur_robot.connection import UrLostError, probe


class Box:
    """Emulated controller.

    Attributes:
        ip: its address.
        process: its process.
    """

    def __init__(self, ip: str) -> None:
        self.ip = ip
        command = ["hric", "ur_controller", "--ip", ip, "--plant", "mujoco_ros_control/MujocoPlant"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        for _ in range(300):
            time.sleep(0.1)
            try:
                return probe(ip, 1.0)
            except UrLostError:
                assert self.process.poll() is None, self.process.stderr.read()
        raise AssertionError("the emulated controller does not start")

    def end(self) -> str:
        """End the process and return its log."""
        self.process.terminate()
        log = self.process.communicate(timeout=20)[1]
        assert self.process.returncode == 0, log
        return log


@pytest.fixture
def box() -> Iterator[Box]:
    made = Box(new_address())
    yield made
    if made.process.poll() is None:
        made.process.kill()
        made.process.wait()
    made.process.stderr.close()
