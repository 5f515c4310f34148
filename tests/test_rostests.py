"""Runs of all .test launch files by rostest, without --text, with which a failing test would end with exit code 0."""

import os
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

pytestmark = pytest.mark.alone

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(ROOT.glob("src/*/test/*.test"))


def rostest(package: str, file: str, home: Path) -> tuple[int, str]:
    environment = {**os.environ, "ROS_HOME": str(home), "ROS_IP": "127.0.0.1"}
    environment.pop("DISPLAY", None)
    done = subprocess.run(["rostest", package, file], capture_output=True, text=True, timeout=180, env=environment)
    results = "\n".join(path.read_text() for path in home.glob("test_results/**/*.xml"))
    return done.returncode, results + done.stdout + done.stderr


@pytest.mark.rostest
@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parents[1].name}/{path.name}")
def test_rostest_passes(path: Path, tmp_path: Path) -> None:
    code, output = rostest(path.parents[1].name, path.name, tmp_path)
    assert code == 0, output
    tests = sum(
        int(ET.parse(result).getroot().get("tests", "0")) for result in tmp_path.glob("test_results/**/rosunit-*.xml")
    )
    assert tests > 0, "the test file ran nothing"


def test_there_is_a_rostest() -> None:
    assert FILES
