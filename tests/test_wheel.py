"""The wheel of scripts/wheel runs experiments in an environment without ROS, with the results of the workspace."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
pytestmark = [pytest.mark.alone, pytest.mark.slow]
BARE = {"PATH": "/usr/bin:/bin", "LANG": "C.UTF-8"}
"""Environment variables of a shell that knows no workspace."""


def run(*words: str | Path, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    variables = BARE | {"HOME": str(folder)} | environment
    return subprocess.run(words, cwd=folder, env=variables, capture_output=True, text=True, timeout=900, check=False)


@pytest.fixture(scope="module")
def hric(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program `hric` of a new environment in which only the wheel was installed."""
    folder = tmp_path_factory.mktemp("wheel")
    built = subprocess.run([ROOT / "scripts/wheel", folder], capture_output=True, text=True, timeout=900, check=False)
    assert built.returncode == 0, built.stderr
    (wheel,) = folder.glob("hric-*.whl")
    assert run("/usr/bin/python3", "-m", "venv", "env", folder=folder).returncode == 0
    sources = {name: value for name, value in os.environ.items() if name.startswith(("PIP_", "SSL_"))}
    installed = run("env/bin/pip", "install", f"{wheel}[learning]", folder=folder, **sources)
    assert installed.returncode == 0, installed.stderr
    return folder / "env/bin/hric"


def test_the_environment_has_no_ros(hric: Path, figure: Callable[[str, float, str], None]) -> None:
    (wheel,) = hric.parents[2].glob("hric-*.whl")
    figure("wheel: size", wheel.stat().st_size / 1e6, "MB")
    for module in ("rospy", "roslib", "catkin"):
        tried = run(hric.with_name("python3"), "-c", f"import {module}", folder=hric.parents[2])
        assert "ModuleNotFoundError" in tried.stderr
    path = run(hric.with_name("python3"), "-c", "import sys; print(*sys.path)", folder=hric.parents[2]).stdout
    assert "dist-packages" not in path and str(ROOT) not in path


def test_all_experiments_of_the_workspace_are_listed(hric: Path, tmp_path: Path) -> None:
    ours = subprocess.run(["hric", "list"], capture_output=True, text=True, check=True)
    theirs = run(hric, "list", folder=tmp_path)
    assert (theirs.stdout, theirs.stderr) == (ours.stdout, "")


@pytest.mark.parametrize("name", ["pd_step", "two_arms", "ur5e_step"])
def test_an_experiment_has_the_bits_of_the_workspace(hric: Path, tmp_path: Path, name: str) -> None:
    ours = subprocess.run(
        ["hric", "run", name, "simulator:=mujoco", "--quiet", "--runs", tmp_path / "ours"], check=False
    )
    theirs = run(hric, "run", name, "--quiet", folder=tmp_path)
    assert (ours.returncode, theirs.returncode) == (0, 0), theirs.stderr
    (a, b) = (yaml.safe_load((tmp_path / f"{runs}/latest/run.yaml").read_text()) for runs in ("ours", "runs"))
    assert a["state_sha256"] == b["state_sha256"]
    assert b["definition"]["robot"]["plant_type"] == "mujoco_ros_control/MujocoPlant"
    assert b["versions"]["hric_control"] == a["versions"]["hric_control"]


EPISODE = """
import gymnasium, hashlib, hric_gym.envs
env = gymnasium.make("hric/Reach-v0")
observation, _ = env.reset(seed=1)
for _ in range(10):
    observation, *_ = env.step(0.5 * env.action_space.high)
print(hashlib.sha256(b"".join(observation[name].tobytes() for name in sorted(observation))).hexdigest())
"""


def test_an_episode_of_a_learning_environment_has_the_bits_of_the_workspace(hric: Path, tmp_path: Path) -> None:
    pytest.importorskip("gymnasium", reason="scripts/setup --with learning")
    ours = subprocess.run([sys.executable, "-c", EPISODE], capture_output=True, text=True, check=True)
    theirs = run(hric.with_name("python3"), "-c", EPISODE, folder=tmp_path)
    assert theirs.stdout == ours.stdout, theirs.stderr


def test_a_run_with_a_person_is_assessed(hric: Path, tmp_path: Path) -> None:
    done = run(hric, "run", "hand_guidance", "--quiet", "--html", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs/latest/report.html").is_file()
    assert "RULA" in run(hric, "assess", "runs/latest", folder=tmp_path).stdout


def test_an_engine_that_is_not_installed_is_refused(hric: Path, tmp_path: Path) -> None:
    done = run(hric, "run", "pd_step", "simulator:=pybullet", folder=tmp_path)
    assert done.returncode == 2 and not (tmp_path / "runs").exists()
    assert done.stderr.splitlines()[-1].endswith("pybullet is not installed; installed engines: mujoco")
