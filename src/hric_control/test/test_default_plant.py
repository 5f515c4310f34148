"""MuJoCo replaces PyBullet as default where PyBullet is not installed, and runs then record it."""

import subprocess
import sys

import pytest

BEFORE = "import sys; sys.modules['pybullet'] = None; "
"""Statements after which Python finds no PyBullet."""
CODE = "from hric_control.plant import DEFAULT_PLANT, REPLACEMENT; print(DEFAULT_PLANT, repr(REPLACEMENT))"


@pytest.mark.parametrize(
    ("code", "printed"),
    [
        (CODE, "pybullet_ros_control/PyBulletPlant ''"),
        (BEFORE + CODE, "mujoco_ros_control/MujocoPlant 'mujoco_ros_control/MujocoPlant'"),
    ],
    ids=["with PyBullet", "without"],
)
def test_the_default_is_an_engine_that_is_installed(code: str, printed: str) -> None:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == printed


def test_an_engine_that_is_not_installed_is_refused_with_those_that_are() -> None:
    code = (
        BEFORE
        + """
from hric_core import plugins
from hric_core.errors import HricError
try:
    plugins.find(plugins.PLANT, "pybullet_ros_control/PyBulletPlant")
except HricError as error:
    print(error)"""
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip().endswith(
        "the Python package pybullet is not installed; installed engines: mujoco, opensim"
    )
