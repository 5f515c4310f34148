"""rviz of the bring-up shows the arm, and shows it moving."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path

from live_system import ROOT, LiveSystem, wait_for
from screen import STILL, changed_pixels, environment, shot, virtual_display, wait_for_picture

SETPOINT = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


def test_rviz_shows_the_arm_and_the_picture_changes_as_it_moves(start: Callable[..., LiveSystem], tmp_path: Path) -> None:
    with virtual_display(tmp_path / "xvfb.txt") as display:
        system = start("env:=sim", "rviz:=true", "record:=false", "q_start:=[0,0,0,-0.3,0,0.5,0]", **environment(display))
        system.wait_running("joint_pd_controller")
        before = wait_for_picture(display, tmp_path / "before.png", timeout=90.0)
        time.sleep(2.0)
        still = shot(display, tmp_path / "still.png")
        system.run("rostopic", "pub", "-1", "/joint_pd_controller/command", "std_msgs/Float64MultiArray", f"{{data: {SETPOINT}}}")
        wait_for(lambda: changed_pixels(before, shot(display, tmp_path / "after.png")) > 5000, 20.0, "a picture of the arm elsewhere")
        time.sleep(4.0)
        shot(display, tmp_path / "after.png")
        assert changed_pixels(before, still) < STILL
        (ROOT / "build/test_results").mkdir(parents=True, exist_ok=True)
        shutil.copy(tmp_path / "after.png", ROOT / "build/test_results/panda_rviz.png")
