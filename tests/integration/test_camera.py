"""A camera beside a running arm: pictures at their rate, and a control loop that does not notice."""

import re
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from live_system import LiveSystem, wait_for

pytestmark = [pytest.mark.alone, pytest.mark.live]
SECONDS = 20.0


def missed(system: LiveSystem) -> float:
    """Deadlines that the control loop missed in a while [1/s]."""

    def total() -> int:
        # The loop and the controller manager send arrays of their own.
        told = system.run("rostopic", "echo", "-n", "4", "/diagnostics").stdout
        found = re.search(r'key: "missed deadlines"\s+value: "(\d+)"', told)
        assert found is not None, told
        return int(found[1])

    before, begun = total(), time.monotonic()
    time.sleep(SECONDS)
    return (total() - before) / (time.monotonic() - begun)


@pytest.mark.parametrize(("width", "height", "rate"), [(160, 120, 10.0), (320, 240, 3.0)])
def test_pictures_come_at_their_rate_and_the_loop_keeps_its_deadlines(
    width: int, height: int, rate: float, tmp_path: Path, figure: Callable[[str, float, str], None]
) -> None:
    system = LiveSystem(tmp_path, "env:=sim", "rviz:=false", "simulator:=mujoco")
    try:
        system.wait_running("joint_pd_controller")
        alone = [missed(system)]
        words = [f"_rate:={rate}", f"_width:={width}", f"_height:={height}"]
        with system.started("rosrun", "mujoco_ros_control", "camera", *words):
            wait_for(lambda: "/camera/image_raw" in system.run("rostopic", "list").stdout, 30.0, "the camera's topics")
            watched = [missed(system)]
            told = system.run("timeout", "10", "rostopic", "hz", "/camera/image_raw", timeout=20.0).stdout
        alone.append(missed(system))
    finally:
        system.close()
    reached = [float(line.split()[-1]) for line in told.splitlines() if line.startswith("average rate")][-1]
    what = f"camera {width} x {height}"
    figure(f"{what}: pictures", reached, "Hz")
    figure(f"{what}: deadlines missed without it", statistics.fmean(alone), "1/s")
    figure(f"{what}: deadlines missed beside it", watched[0], "1/s")
    assert reached >= 0.95 * rate
    assert watched[0] <= max(alone) + 1.0
