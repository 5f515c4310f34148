"""Tests of every command with every fault: full or failing disk, too many open files, SIGKILL, a flipped bit.

Each command must end with one line and the documented exit code and leave no incomplete files; complete files must
stay readable. A new command is tested automatically, with the arguments `DEFAULT`. The cases (cells) of the default run
are forks of one process that has loaded the commands (cells.py); faults are injected by shim.c. Exit codes: 0 done, 1
failed, 2 wrong usage or an unreadable input, 3 and 4 findings or unfinished runs.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet
import pytest
import yaml

from hric_bags.run_folder import RunFolder
from hric_core import plugins
from hric_core.command import perform
from hric_human.body import Subject, describe
from hric_motion.postures import BodyPostures, MarkerPostures

pytestmark = pytest.mark.alone

HERE = Path(__file__).resolve().parent
SOURCES = HERE.parents[1] / "src"
ENOSPC, EIO, EMFILE = "No space left on device", "Input/output error", "Too many open files"

NODES = {
    *("experiment", "recorder", "spawn", "supervisor", "robot", "spawner", "unspawner", "controller_manager"),
    *("franka_gripper", "control_box", "emulated_arm", "emulated_motive", "natnet_client", "body", "camera", "emg"),
    *("emulated_emg", "emulated_human", "emulated_plate", "force_plate", "live_plot", "live_view", "person"),
    *(
        "view",
        "window",
        "try",
        "synchronizer",
        "synchronizer_cpp",
        "calibrate",
        "check_workstation",
        "xacro",
        "hric",
        "equilibrium_marker",
    ),
}
"""Programs that are not tested here.

They need a ROS master, or wait for a peer or viewer (their faults are in tests/integration/test_killed.py), check the
machine, are ROS's own xacro, or are the program that the others are aliases of.
"""
SERVERS = {"ur_controller"}
"""Commands without a program of the same name that wait for a peer, so that they are not tested here."""
NO_FILES = {"schema"}
"""Commands that neither read nor write files of the user, so that only their standard output can fail."""
DEFAULT = ["run"]
RECIPES: dict[str, list[str]] = {
    "run": ["pd_step", "duration:=0.2", "--runs", ".", "--quiet", "--no-figures"],
    "run study": ["study.yaml", "--runs", ".", "--quiet", "--no-figures"],
    "report": ["run", "--no-figures"],
    "report figures": ["run", "--html"],
    "compare": ["run", "run", "--output", "compared", "--no-figures"],
    "export": ["run", "--format", "npz", "csv", "parquet", "bag", "sto", "--quiet"],
    "export anonymised": ["run", "--format", "csv", "bag", "--anonymise", "--quiet"],
    "health salvage": ["cut.bag", "--salvage", "--quiet"],
    "describe": ["robot", "pd_step"],
    "list": [],
    "schema": [],
    "reproduce": ["elbow_of_women", "--out", "reproduced"],
    "identify_load": ["run", "--empty", "run"],
    "check_model": ["long", "--out", "checked", "--no-figures"],
    "muscle_load": ["person", "--output", "load"],
    "measure_stops": ["--speeds", "0.2", "--loads", "0", "-o", "stops.yaml"],
    "measure_contact": ["-o", "sheet.pdf"],
    "speed_map": ["--x", "0.4", "0.5", "1", "--y", "0", "0.1", "1", "--z", "0.3", "0.4", "1", "-o", "map"],
    "approaches": ["--count", "1", "--jobs", "1", "--output", "approaches.jsonl"],
    "benchmark": ["--definition", "benchmark.yaml", "--without-references", "own_controller.yaml", "--jobs", "1",
                  "--runs", ".", "--quiet"],
    "sweep": ["sweep.yaml", "--jobs", "1", "--runs", ".", "--quiet"],
    "fit_muscles": ["nobody.osim"],
    "urdf": [],
    "inertials": [],
    "picture": ["nobody.osim", "nobody.png"],
    "film": ["run", "--output", "film.gif"],
    "trial": ["standing.trc", "-o", "trials"],
    "urdf_to_osim": ["run/robot.urdf", "-o", "model.osim"],
    "note": ["run", "a remark"],
    "port": ["controller.py", "--output", "ported"],
    "import": ["run/export/lerobot", "-o", "episode.yaml"],
}  # fmt: skip
"""Arguments of each command, or variant of a command, in a folder with the files made by `given`."""
REFUSED = {"fit_muscles", "film", "picture", "inverse_kinematics", "identify_load", "train", "check_policy"}
"""Commands that take seconds with a valid input; they are tested with an input that they refuse."""
COSTLY = {
    "sweep", "benchmark", "approaches", "measure_stops", "measure_contact", "speed_map", "report figures", "run study"
}  # fmt: skip
"""Commands that are tested in the default run with a single fault, which hits each of them."""
FEW_WRITES = {"approaches", "measure_stops", "measure_contact"}
"""Costly commands that may write too rarely to be hit by a later fault."""

FAULTS: dict[str, dict[str, str]] = {
    "nothing": {},
    "disk full at once": {"FAULT_CALL": "write", "FAULT_NTH": "1", "FAULT_ERRNO": "28"},
    "disk full later": {"FAULT_CALL": "write", "FAULT_NTH": "4", "FAULT_ERRNO": "28"},
    "disk broken": {"FAULT_CALL": "write", "FAULT_NTH": "2", "FAULT_ERRNO": "5"},
    "disk unreadable": {"FAULT_CALL": "read", "FAULT_NTH": "2", "FAULT_ERRNO": "5"},
    "no more files": {"FAULT_CALL": "open", "FAULT_NTH": "3", "FAULT_ERRNO": "24"},
    "killed": {"FAULT_CALL": "write", "FAULT_NTH": "3", "FAULT_ERRNO": "0"},
    "flipped bit in run.yaml": {"FLIP": "run.yaml"},
    "flipped bit in the bag": {"FLIP": "*.bag"},
    "flipped bit in metrics.json": {"FLIP": "metrics.json"},
}
MESSAGES = {"28": ENOSPC, "5": EIO, "24": EMFILE}
INPUTS = {"run", "long", "person", "cut.bag"}


@dataclass(frozen=True)
class Cell:
    """Case of the matrix: a command, or a variant of it, with a fault."""

    command: str
    fault: str

    @property
    def call(self) -> list[str]:
        """File of the command's node, or `hric` and the command's name if it has no node of its own; its arguments."""
        name = self.command.split()[0]
        own = [str(path) for path in SOURCES.glob(f"*/nodes/{name}")]
        return [*(own or [str(SOURCES / "hric_core/nodes/hric"), name]), *self.words]

    @property
    def words(self) -> list[str]:
        """Arguments of the command."""
        return RECIPES.get(self.command, DEFAULT)

    @property
    def fits(self) -> bool:
        """False if the command does nothing that the fault can affect."""
        reads = INPUTS & set(self.words)
        if "flipped" in self.fault:
            return bool(reads) and not ("metrics" in self.fault and "cut.bag" in self.words)
        return self.command not in NO_FILES or self.fault == "disk full at once" or self.fault == "nothing"


def commands() -> list[str]:
    """Return the names of all commands and of their variants."""
    nodes = {path.name for path in SOURCES.glob("*/nodes/*")}
    assert nodes >= NODES
    programs = nodes | {name for name in plugins.names(plugins.COMMAND) if name != "convert" and " " not in name}
    return sorted(programs - NODES - SERVERS | set(RECIPES))


def cells() -> Iterator[Any]:
    """Yield all cases; in the default run, costly commands have one case each."""
    for command in commands():
        fitting = [cell for fault in FAULTS if (cell := Cell(command, fault)).fits]
        strikes = "disk full at once" if command in FEW_WRITES else "disk full later"
        quick = [cell for cell in fitting if command not in COSTLY or cell.fault == strikes]
        for cell in fitting:
            marks = [] if cell in quick else [pytest.mark.slow]
            yield pytest.param(cell, id=f"{command}, {cell.fault}", marks=marks)


@dataclass(frozen=True)
class Ended:
    """Result of a case.

    Attributes:
        folder: working folder.
        code: exit code, or minus the number of the signal that killed the process.
        lines: lines of stderr, without progress.
        hit: True if the fault occurred.
        spent: processor time [s].
    """

    folder: Path
    code: int
    lines: list[str]
    hit: bool
    spent: float


@pytest.fixture(scope="session")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a run of 0.2 s, a run with a person, a longer run, a truncated bag, and other input files."""
    folder = tmp_path_factory.mktemp("given")
    options = ["--runs", str(folder / "made"), "--quiet", "--no-figures"]
    for name, words in (
        ("run", ["pd_step", "duration:=0.2"]),
        ("person", ["co_transport", "duration:=0.3"]),
        ("long", ["pd_step", "duration:=2.7"]),
    ):
        assert perform(["run", *words, *options]) == 0
        made = (folder / "made" / "latest").resolve()
        shutil.move(made, folder / name)
    shutil.rmtree(folder / "made")
    (bag,) = (folder / "run").glob("*.bag")
    (folder / "cut.bag").write_bytes(bag.read_bytes()[: bag.stat().st_size * 2 // 3])
    assert perform(["export", str(folder / "run"), "--format", "lerobot", "--quiet"]) == 0
    (folder / "controller.py").write_text("import rospy\n\nrospy.Subscriber('joint_states', JointState, print)\n")
    write_definitions(folder)
    write_trial(folder / "standing.trc")
    return folder


def write_trial(path: Path) -> None:
    """Markers of a person who stands still for 0.2 s."""
    body = describe(Subject(code="S1", mass=70.0, height=1.7, sex="female", parts="whole_body"))
    still = BodyPostures(np.eye(3)[None], np.array([[0.0, 0.0, 0.9]]), np.zeros((1, len(body.joints))))
    p = MarkerPostures(body, tuple(body.markers)).positions(still)[0][:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    places = "\t".join(f"{value:.6f}" for value in p.ravel())
    rows = [f"{k + 1}\t{k / 50}\t{places}" for k in range(10)]
    names = "\t\t\t".join(body.markers)
    head = ["PathFileType\t4\t(X/Y/Z)\tstanding.trc", "DataRate\tUnits", "50\tm", f"Frame#\tTime\t{names}", "\t\tX1"]
    path.write_text("\n".join([*head, *rows]) + "\n")


def write_definitions(folder: Path) -> None:
    """Files of a study, a sweep and a benchmark with runs of 0.2 s."""
    form = {"experiment": "pd_step", "changes": ["duration:=0.2"], "runs": {"a": [], "b": ["kp:=150"]}}
    form["compared"] = [{"runs": ["a", "b"]}]
    study = {"description": "two gains", "forms": {"gains": form}}
    (folder / "study.yaml").write_text(yaml.safe_dump(study))
    kp = {
        "paths": ["parameters.joint_pd_controller.kp"],
        "unit": "N m/rad",
        "text": "gain",
        "distribution": {"kind": "uniform", "low": 100.0, "high": 200.0},
    }
    error = {"path": "setpoints.0.final_error_max", "unit": "rad", "text": "error"}
    sweep = {"vary": {"kp": kp}, "sampler": {"kind": "random"}, "runs": 2, "outputs": {"error": error}}
    head = {"description": "gains", "extends": "pd_step", "changes": ["duration:=0.2"]}
    (folder / "sweep.yaml").write_text(yaml.safe_dump({**head, "sweep": sweep}))
    content = yaml.safe_load((SOURCES / "hric_experiments/config/benchmark/collaborations.yaml").read_text())
    one = content["collaborations"]["hand_guidance"]
    one["changes"] = [*(text for text in one["changes"] if not text.startswith("duration")), "duration:=0.2"]
    content |= {"collaborations": {"hand_guidance": one}, "seeds": [0]}
    content["population"]["bodies"] = {"p50": content["population"]["bodies"]["p50"]}
    (folder / "benchmark.yaml").write_text(yaml.safe_dump(content))
    controller = {"description": "as it is", "changes": {"hand_guidance": ["duration:=0.2"]}}
    (folder / "own_controller.yaml").write_text(yaml.safe_dump(controller))


@pytest.fixture(scope="session")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Path of the compiled preload library."""
    path = tmp_path_factory.mktemp("shim") / "shim.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", path, HERE / "shim.c", "-ldl"], check=True)
    return path


@pytest.fixture(scope="session")
def ended(
    request: pytest.FixtureRequest, given: Path, shim: Path, tmp_path_factory: pytest.TempPathFactory
) -> dict[Cell, Ended]:
    """Results of all selected cases."""
    items = [item for item in request.session.items if item.path == Path(__file__) and hasattr(item, "callspec")]
    chosen = dict.fromkeys(item.callspec.params["cell"] for item in items if "cell" in item.callspec.params)
    root = tmp_path_factory.mktemp("cells")
    requests = [prepared(cell, root / str(number), given) for number, cell in enumerate(chosen)]
    environment = os.environ | {"LD_PRELOAD": str(shim), "OPENBLAS_NUM_THREADS": "1", "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, str(HERE / "cells.py")],
        input=json.dumps(requests),
        capture_output=True,
        text=True,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    found = {}
    for cell, asked, (code, spent) in zip(chosen, requests, json.loads(done.stdout), strict=True):
        lines = [line for line in Path(asked["stderr"]).read_text().splitlines() if not re.search(r", step \d", line)]
        found[cell] = Ended(Path(asked["folder"]), code, lines, Path(asked["hit"]).exists(), spent)
    return found


def prepared(cell: Cell, root: Path, given: Path) -> dict[str, Any]:
    """Return the request to run a case in a separate folder."""
    folder = root / "here"
    shutil.copytree(given, folder, symlinks=True)
    fault = dict(FAULTS[cell.fault])
    if pattern := fault.pop("FLIP", ""):
        flip(folder, cell, pattern)
    if fault:
        config = ":".join(map(str, SOURCES.glob("*/config"))) if fault["FAULT_CALL"] != "write" else ""
        fault |= {"FAULT_UNDER": f"{folder}:{config}", "FAULT_HIT": str(root / "hit")}
    own = {"HRIC_RUNS": str(folder), "HOME": str(root), "XDG_CACHE_HOME": str(root / "cache")}
    return {
        "call": cell.call,
        "folder": str(folder),
        "environment": own | fault,
        "stderr": str(root / "stderr.txt"),
        "hit": str(root / "hit"),
        "timeout": 120.0,
    }


def flip(folder: Path, cell: Cell, pattern: str) -> None:
    """Flip a bit in the middle of each file that the command reads."""
    for name in INPUTS & set(cell.words):
        paths = [folder / name] if name.endswith(".bag") else list((folder / name).glob(pattern))
        for path in paths:
            content = bytearray(path.read_bytes())
            content[len(content) // 2] ^= 0x10
            path.write_bytes(content)


READERS: dict[str, Callable[[Path], object]] = {
    ".json": lambda path: json.loads(path.read_text()),
    ".yaml": lambda path: yaml.safe_load(path.read_text()),
    ".npz": lambda path: [array.shape for array in np.load(path).values()],
    ".parquet": pyarrow.parquet.read_table,
    ".csv": lambda path: path.read_text().splitlines()[-1],
}
"""Functions that read a whole file, by its suffix."""


def half_written(folder: Path, flipped: str) -> list[str]:
    """Return the files with final (not temporary) names that cannot be read."""
    found = []
    for path in folder.rglob("*"):
        visible = not any(part.startswith(".") for part in path.relative_to(folder).parts)
        if visible and path.is_file() and path.suffix in READERS and not (flipped and path.match(flipped)):
            try:
                READERS[path.suffix](path)
            except Exception as error:
                found.append(f"{path.relative_to(folder)}: {error}")
    return found


@pytest.mark.parametrize("cell", list(cells()))
def test_a_fault_is_one_line_and_the_right_code_and_nothing_is_half_written(
    cell: Cell, ended: dict[Cell, Ended]
) -> None:
    result = ended[cell]
    said = "\n".join(result.lines)
    assert "Traceback" not in said and "Exception ignored" not in said, said
    fault = FAULTS[cell.fault]
    if cell.fault == "killed" and result.hit:
        assert result.code == -9, said
    elif fault.get("FAULT_ERRNO") and result.hit:
        message = MESSAGES[fault["FAULT_ERRNO"]]
        assert result.code in ((1, 3) if fault["FAULT_CALL"] == "write" else (1, 2, 3, 4)), said
        assert len(result.lines) == 1 and message in said, said
    elif cell.fault == "nothing" or fault.get("FAULT_ERRNO"):
        assert result.code in (0, 3, 4) or cell.command in REFUSED, said
    else:
        assert result.code in (0, 1, 2, 3, 4) and len(result.lines) <= 1, said
    assert half_written(result.folder, fault.get("FLIP", "")) == []
    for path in result.folder.glob("*/run.yaml"):
        if not fault.get("FLIP"):
            assert RunFolder(path.parent).read().get("status") != "running", path


def test_what_the_matrix_has(ended: dict[Cell, Ended], record_property: Callable[[str, object], None]) -> None:
    record_property("cells", len(ended))
    assert {cell.command for cell in ended} == set(commands())
    assert {cell.fault for cell in ended} == set(FAULTS)
    hits: Sequence[Cell] = [cell for cell, result in ended.items() if result.hit]
    assert {cell.command for cell in hits} >= COSTLY
    assert {cell.fault for cell in hits} == {name for name, fault in FAULTS.items() if "FAULT_ERRNO" in fault}
