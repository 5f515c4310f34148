"""Conversion and proof take little more than what they load; in processor time, as ratios within one run."""

import os
import re
import resource
import statistics
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import panda_description

COMMAND = Path(__file__).resolve().parents[1] / "nodes" / "urdf_to_osim"
RUNS = 5
"""Of both commands in turn; the median of their ratios counts."""
LARGEST = 2.5
"""Times the bare import of OpenSim; measured: 1.6 to 2.0, of which loading the rigid-body library is 0.4."""


def processor_time(folder: Path, *words: str) -> float:
    """Return the processor time of one command [s], without the forward simulation of a conversion."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    forward = re.search(r"^forward .*, ([\d.]+) s of processor time in all", done.stdout, re.MULTILINE)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime - (float(forward[1]) if forward else 0.0)


@pytest.mark.slow
def test_conversion_and_proof_without_meshes_take_at_most_two_and_a_half_times_the_import_of_opensim(
    tmp_path: Path, figure: Callable[..., None]
) -> None:
    (tmp_path / "panda.urdf").write_text(panda_description.load(fingers="prismatic"))
    commands = (("-c", "import opensim"), (str(COMMAND), "panda.urdf", "--no-meshes"))
    rounds = [[processor_time(tmp_path, *words) for words in commands] for _ in range(RUNS)]
    ratio = statistics.median(whole / bare for bare, whole in rounds)
    figure("conversion and proof of the Panda beside the import of OpenSim", ratio, "1")
    assert (tmp_path / "panda.osim").is_file()
    assert ratio < LARGEST


def test_who_only_converts_does_not_load_the_library_of_the_proof(tmp_path: Path) -> None:
    code = (
        "import sys, urdf_to_osim; print([name for name in ('pinocchio', 'trimesh', 'scipy', 'collada', "
        "'xacro', 'yaml') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == "[]\n"
