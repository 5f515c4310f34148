"""Camera of a running simulated arm: rate of its pictures, and no effect on the deadlines of the control loop."""

import re
import signal
import statistics
import subprocess
import threading
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from live_system import LiveSystem, wait_for

pytestmark = [pytest.mark.alone, pytest.mark.live]
UNCHANGED = 0.05
"""Allowed increase of the missed deadlines due to the camera, as a share of those missed without it."""
WINDOW, PAIRS = 5.0, 10
"""Duration of each phase with and without camera [s], and number of pairs of phases.

The phases alternate, since the number of missed deadlines without camera changes by a factor of five within minutes on
a shared machine.
"""


class Deadlines:
    """Number of deadlines that the control loop has missed, read from /diagnostics once per second."""

    def __init__(self, system: LiveSystem) -> None:
        self._echo = subprocess.Popen(
            ["rostopic", "echo", "/diagnostics"], env=system.environment, stdout=subprocess.PIPE, text=True
        )
        self.missed: list[int] = []
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self._echo.stdout is not None
        named = False
        for line in self._echo.stdout:
            if named:
                self.missed.append(int(re.sub(r"\D", "", line)))
            named = 'key: "missed deadlines"' in line

    def within(self, seconds: float) -> float:
        """Return the rate of missed deadlines over the next seconds [1/s]."""
        before, begun = len(self.missed), time.monotonic()
        wait_for(lambda: len(self.missed) > before + seconds, 4 * seconds, "diagnostics")
        return (self.missed[-1] - self.missed[before]) / (time.monotonic() - begun)

    def close(self) -> None:
        self._echo.kill()
        self._echo.wait()
        self._thread.join()


@pytest.mark.parametrize(("width", "height", "rate"), [(160, 120, 10.0), (320, 240, 3.0)])
def test_pictures_come_at_their_rate_and_the_loop_keeps_its_deadlines(
    width: int, height: int, rate: float, tmp_path: Path, figure: Callable[[str, float, str], None]
) -> None:
    system = LiveSystem(tmp_path, "env:=sim", "rviz:=false", "simulator:=mujoco")
    try:
        system.wait_running("joint_pd_controller")
        words = [f"_rate:={rate}", f"_width:={width}", f"_height:={height}"]
        with system.started("rosrun", "mujoco_ros_control", "camera", *words) as camera:
            wait_for(lambda: "/camera/image_raw" in system.run("rostopic", "list").stdout, 30.0, "the camera's topics")
            told = system.run("timeout", "10", "rostopic", "hz", "/camera/image_raw", timeout=20.0).stdout
            deadlines, beside, alone = Deadlines(system), [], []
            for _ in range(PAIRS):
                camera.send_signal(signal.SIGSTOP)
                alone.append(deadlines.within(WINDOW))
                camera.send_signal(signal.SIGCONT)
                beside.append(deadlines.within(WINDOW))
            deadlines.close()
    finally:
        system.close()
    reached = [float(line.split()[-1]) for line in told.splitlines() if line.startswith("average rate")][-1]
    more = statistics.median(b - a for a, b in zip(alone, beside, strict=True))
    unrest = statistics.median(abs(b - a) for a, b in pairwise(alone))
    what = f"camera {width} x {height}"
    figure(f"{what}: pictures", reached, "Hz")
    figure(f"{what}: deadlines missed without it", statistics.median(alone), "1/s")
    figure(f"{what}: more of them beside it", more, "1/s")
    figure(f"{what}: change from one while without it to the next", unrest, "1/s")
    assert reached >= 0.95 * rate
    assert more <= UNCHANGED * statistics.median(alone) + 1.0
