"""Check that rviz in the bring-up shows the arm and its motion."""

import re
import shutil
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from live_system import ROOT, LiveSystem, wait_for
from screen import STILL, changed_pixels, environment, shot, virtual_display, wait_for_picture

pytestmark = [pytest.mark.alone, pytest.mark.slow]

SETPOINT = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


def has_died(system: LiveSystem, name: str) -> bool:
    """Return True if a node of the bring-up ended by itself."""
    return re.search(rf"\[{name}-\d+\] process has died", system.output) is not None


def test_rviz_shows_the_arm_and_the_picture_changes_as_it_moves(
    start: Callable[..., LiveSystem], tmp_path: Path
) -> None:
    with virtual_display(tmp_path / "xvfb.txt") as display:
        system = start(
            "env:=sim", "rviz:=true", "record:=false", "q_start:=[0,0,0,-0.3,0,0.5,0]", **environment(display)
        )
        system.wait_running("joint_pd_controller")
        died = partial(has_died, system, "rviz")
        before = wait_for_picture(display, tmp_path / "before.png", 90.0, died)
        time.sleep(1.0)
        still = shot(display, tmp_path / "still.png")
        system.run(
            "rostopic",
            "pub",
            "-1",
            "/joint_pd_controller/command",
            "std_msgs/Float64MultiArray",
            f"{{data: {SETPOINT}}}",
        )
        wait_for(
            lambda: changed_pixels(before, shot(display, tmp_path / "after.png")) > 5000,
            20.0,
            "a picture of the arm elsewhere",
        )
        wait_for_picture(display, tmp_path / "after.png", 20.0, died)
        assert changed_pixels(before, still) < STILL
        assert "rospack" not in system.output, system.output
        (ROOT / "build/test_results").mkdir(parents=True, exist_ok=True)
        shutil.copy(tmp_path / "after.png", ROOT / "build/test_results/panda_rviz.png")
