"""Comparison of one experiment in process and through libfranka with the emulated control box: same motion."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from fci_peer import control_box, log_of

from hric_bags import reader as bag_reader
from hric_report import headless
from hric_run.definition import experiment

pytestmark = pytest.mark.alone

Q_START = ("0", "0", "0", "-0.08", "0", "0", "0")
"""Joint positions at the start of pd_step [rad]."""
PLAIN = ("robot.parameters.rate_limiting:=false", "robot.parameters.cutoff_frequency:=1000")
"""Arguments that disable libfranka's rate limiter and low-pass filter."""


def run(folder: Path, name: str, *arguments: str) -> Path:
    """Run an experiment headless and return the run folder."""
    folder.mkdir(exist_ok=True)
    return headless.run(
        experiment.load(name, arguments), arguments, root=folder, progress=False, figures=False
    ).folder.path


def through_libfranka(
    folder: Path, robot: str, name: str, *arguments: str, q_start: tuple[str, ...] = Q_START
) -> tuple[Path, str]:
    """Run an experiment through libfranka; return the run folder and the log of the emulated control box."""
    with control_box("--robot", robot, "--no-hand", "--real-time-factor", "0", "--q-start", *q_start) as (address, box):
        real = ("hw:=franka_real/FrankaHW", f"robot.parameters.robot_ip:={address}", f"robot.parameters.robot:={robot}")
        path = run(
            folder,
            name,
            *real,
            "robot.parameters.realtime_priority:=0",
            "robot.parameters.lock_memory:=false",
            *arguments,
        )
        return path, log_of(box)


def positions(path: Path) -> np.ndarray:
    """Return the joint positions of all cycles, shape (n, 7) [rad]."""
    return bag_reader.read(next(path.glob("*.bag"))).log.position


def head(path: Path) -> dict[str, Any]:
    """Return the contents of run.yaml."""
    contents: dict[str, Any] = yaml.safe_load((path / "run.yaml").read_text())
    return contents


def difference(a: Path, b: Path) -> float:
    """Return the largest difference of joint positions between two runs in any cycle [rad]."""
    one, other = positions(a), positions(b)
    assert len(one) == len(other) == 6000
    return float(np.abs(one - other).max())


@pytest.mark.parametrize(
    ("robot", "inertials", "bound"), [("panda", "barycentric", 1e-9), ("fr3", "fr3", 1e-6)], ids=["panda", "fr3"]
)
def test_without_filter_and_limiter_the_motion_is_that_of_the_simulation(
    robot: str, inertials: str, bound: float, tmp_path: Path
) -> None:
    real, _ = through_libfranka(tmp_path / "real", robot, "pd_step", *PLAIN, f"inertials:={inertials}")
    found = difference(run(tmp_path / "sim", "pd_step", f"inertials:={inertials}"), real)
    print(f"{robot}: largest difference {found:.2e} rad")
    assert found < bound


@pytest.mark.parametrize("gains", [("kp:=50", "kd:=10"), pytest.param(("kp:=200", "kd:=100"), marks=pytest.mark.slow)])
def test_with_libfrankas_filter_and_limiter_it_stays_near(gains: tuple[str, str], tmp_path: Path) -> None:
    real, _ = through_libfranka(tmp_path / "real", "panda", "pd_step", *gains)
    found = difference(run(tmp_path / "sim", "pd_step", *gains), real)
    print(f"{gains}: largest difference {found:.2e} rad")
    assert 0.0 < found < 1e-2


def test_the_raw_step_of_the_thesis_ends_in_a_reflex_by_name(tmp_path: Path) -> None:
    zeros = ("0",) * 7
    path, said = through_libfranka(tmp_path, "panda", "thesis_step", "gravity:=false", "duration:=0.5", q_start=zeros)
    assert "joint_velocity_violation (panda_joint4" in said
    steps = np.abs(np.diff(positions(path), axis=0))
    # It stands; how much of its ringing is over by the end of the log depends on the machine's pace.
    assert steps[-50:].max() < 5e-3 * steps.max()
    assert "joint_velocity_violation" in head(path)["arm_error"]


def test_a_run_whose_arm_ends_in_its_error_state_says_so_and_one_in_good_order_does_not(tmp_path: Path) -> None:
    fast = ("duration:=1.5", "kp:=200", "kd:=5", "parameters.joint_pd_controller.profile.velocity:=5.0")
    assert "joint_velocity_violation" in head(run(tmp_path / "fast", "pd_step", *fast))["arm_error"]
    assert "arm_error" not in head(run(tmp_path / "usual", "pd_step", "duration:=0.2"))
