"""Results of all headless experiments as hashes and values per topic, to detect unintended changes of results.

    python3 tests/headless_hashes.py --write [NAME...]  # writes headless_hashes.json for the named runs, or all
    python3 tests/headless_hashes.py [NAME...]          # makes these runs again, and prints differences
    python3 -m pytest tests/test_headless_hashes.py     # the same; with -m "not slow": quick runs only

Each run uses the public command, `hric run`, but within this process. bag_digest.py defines which fields of a bag are
compared and how. Write the list again only if a change is meant to change the results of a run, and name this run and
the reason in the commit message.

Not in the list: EMG, force plates and synchroniser of data_collection, which the headless runner refuses; replay of a
recorded trial; runs that diverge.

With the vector code of BLAS, numpy and the C library disabled, which imitates another processor, positions and
velocities change by at most 1e-12. Exceptions are `thesis_step thesis`, which chatters (1.6e-2 on PyBullet; 6e-8 on
MuJoCo, due to BLAS for AVX-512: with OPENBLAS_CORETYPE=Haswell such a processor gives the results of the list); values
divided by the cycle of a millisecond, `dtau_J` and `ddq_d` (up to 4e-9 of the largest value); and in marker_tracking
and with contact the efforts and forces derived from positions (up to 1.4e-10), for which bag_digest.py has a larger
tolerance.
"""

import argparse
import contextlib
import functools
import io
import json
import platform
import runpy
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import rospkg
import yaml

sys.path.insert(0, str(Path(__file__).parent))
import bag_digest

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "headless_hashes.json"
DISTRIBUTIONS = ("numpy", "scipy", "pybullet", "opensim", "mujoco", "ruckig")
DEBIAN = ("python3-pykdl", "liborocos-kdl1.5")
FEATURES = ("sse4_1", "avx", "fma", "avx2", "avx512f", "avx512dq", "avx512bw", "avx512vl", "avx512_vnni", "avx512_bf16")
"""Processor features by which numpy, BLAS and the C library select their code."""
CHATTERING = ("thesis_step thesis on pybullet", "thesis_step thesis on mujoco")
"""Runs at the edge of stability, in which rounding errors grow: compared only on the processor of the list."""
SIMULATORS = ("pybullet", "opensim", "mujoco")
WALL = "world:=package://pybullet_ros_control/worlds/wall.yaml"
TABLE = "world:=package://pybullet_ros_control/worlds/table.yaml"
BEFORE_WALL = "q_start:=[0, -0.2, 0, -2.2, 0, 2.0, 0.785]"
INTO_WALL = "setpoints.0.positions:=[0, 0.5, 0, -1.8, 0, 2.0, 0.785]"
REDUCED = (
    "damping:=0",
    "rotor_inertia:=0",
    "friction:=none",
    "limits:=false",
    "rotatum_limit:=0",
    "robot.plant.passive_joints:=locked",
)
"""Overrides of the study `engines`, form `reduced`."""
MEASURED_LEFT = "arms.left.robot.parameters.realism:=measured"
HAND_MOVES = ("mocap.human.begin:=0.1", "mocap.human.ramp:=0.3")
NO_WIRES = ("emg", "force_plate", "sync")


@dataclass(frozen=True)
class Run:
    """A headless run to compare.

    Attributes:
        experiment: name of an experiment, or path of its file in the workspace.
        overrides: overrides key:=value.
        seed: seed of all random values.
        without: sections of the experiment file that are left out.
        quick: True if the run is part of the default tests.
    """

    experiment: str
    overrides: tuple[str, ...]
    seed: int = 0
    without: tuple[str, ...] = ()
    quick: bool = False

    def on(self, simulator: str, *more: str, quick: bool = False) -> "Run":
        """Return this run with an engine and additional overrides."""
        return replace(self, overrides=(*self.overrides, f"simulator:={simulator}", *more), quick=quick)


def _on_each() -> dict[str, tuple[Run, tuple[str, ...]]]:
    """Return the runs that are made on all engines by name, each with the engines on which it is quick."""
    tracking = ("duration:=1.0", *HAND_MOVES)
    reaction = "rest: [0.6, -0.2, 0.45], approach: 0.5, reaction_delay: 0.1, still_speed: 1.0"
    reactive = f"mocap.human:={{program: reactive, {reaction}}}"
    points = "points: [[0.1, 0.6, 0, 0.5], [0.7, 0.6, 0.1, 0.5]], variation: {position: 0.01, time: 0.1}"
    minimum_jerk = f"mocap.human:={{program: minimum_jerk, {points}}}"
    measured = ("realism:=measured", "friction:=identified")
    setpoint = "{time: 0.2, controller: joint_pd_controller, positions: [0.4, -0.6, 0, -2.2, 0, 1.6, 0.8]}"
    collected = ("duration:=1.5", f"setpoints:=[{setpoint}]")
    fast = ("parameters.joint_pd_controller.profile.velocity:=5.0", "kp:=200", "kd:=5")
    semi_implicit = "robot.plant.integrator:=semi_implicit"
    kinds = ("cartesian_impedance", "effort_joint_trajectory", "position_joint_trajectory")
    holding = "controllers:=[joint_state_controller, franka_state_controller, {}_controller]"
    return {
        "pd_step": (Run("pd_step", ("duration:=1.0",)), ("pybullet", "mujoco")),
        "pd_step stiff": (Run("pd_step", ("duration:=0.8", "kp:=200", "kd:=100")), ()),
        "pd_step measured": (Run("pd_step", ("duration:=0.8", *measured), seed=7), ()),
        "pd_step coulomb": (Run("pd_step", ("duration:=0.8", "friction:=coulomb")), ()),
        "pd_step full": (Run("pd_step", ("duration:=1.0", "rotor_inertia:=0.1", "friction:=identified")), ()),
        "pd_step reflex": (Run("pd_step", ("duration:=0.8", *fast)), ()),
        "pd_step wall": (Run("pd_step", ("duration:=1.0", "hand:=true", WALL, BEFORE_WALL, INTO_WALL)), ("pybullet",)),
        "pd_step table": (Run("pd_step", ("duration:=0.5", TABLE)), ()),
        "thesis_step": (Run("thesis_step", ("duration:=1.0",)), ("opensim",)),
        "thesis_step thesis": (Run("thesis_step", ("duration:=1.0", "inertials:=thesis", "rotor_inertia:=0")), ()),
        "thesis_step reduced": (Run("thesis_step", ("duration:=0.8", *REDUCED)), ()),
        "thesis_step reduced semi_implicit": (Run("thesis_step", ("duration:=0.8", *REDUCED, semi_implicit)), ()),
        "thesis_step wall": (Run("thesis_step", ("duration:=1.0", WALL, BEFORE_WALL, INTO_WALL)), ()),
        "marker_tracking": (Run("marker_tracking", tracking), ("pybullet",)),
        "marker_tracking thesis": (Run("marker_tracking", (*tracking, "mode:=thesis")), ()),
        "marker_tracking measured": (Run("marker_tracking", (*tracking, *measured), seed=7), ()),
        "marker_tracking reactive": (Run("marker_tracking", ("duration:=1.5", reactive), seed=3), ()),
        "marker_tracking minimum_jerk": (Run("marker_tracking", ("duration:=1.0", minimum_jerk), seed=3), ()),
        "data_collection": (Run("data_collection", collected, without=NO_WIRES), ()),
        "hold": (Run("tests/benchmarks/hold.yaml", ("duration:=0.5",)), ("pybullet",)),
        "none": (Run("none", ("duration:=0.5",)), ()),
        "two_arms": (Run("two_arms", ("duration:=1.2",)), ("mujoco",)),
        "two_arms_contact": (Run("two_arms_contact", ("duration:=4.4",)), ()),
        "leader_follower": (Run("leader_follower", ("duration:=2.6", MEASURED_LEFT)), ()),
        **{f"none {kind}_controller": (Run("none", ("duration:=0.5", holding.format(kind))), ()) for kind in kinds},
    }


def _runs() -> dict[str, Run]:
    each = _on_each()
    pairs = [(name, engine) for name in each for engine in SIMULATORS]
    runs = {f"{name} on {engine}": each[name][0].on(engine, quick=engine in each[name][1]) for name, engine in pairs}
    seen = (
        "mocap.stream.occlusions:=[[0.4, 0.3]]",
        "mocap.stream.loss:=0.1",
        "mocap.base_from_mocap:={xyz: [1.0, -0.5, 0.2], xyzw: [0, 0, 0.6, 0.8]}",
    )
    by_effort = "controllers:=[joint_state_controller, franka_state_controller, cartesian_pose_impedance_controller]"
    raw = ("robot.plant.integrator:=semi_implicit", "robot.plant.half_step_readout:=false")
    reduced = Run("thesis_step", ("duration:=0.8", *REDUCED))
    tracking = Run("marker_tracking", ("duration:=1.0", *HAND_MOVES))
    return runs | {
        "thesis_step reduced raw on pybullet": reduced.on("pybullet", *raw),
        "thesis_step reduced study on opensim": reduced.on("opensim", "robot.plant.effort_limits:=false"),
        "marker_tracking seen badly on pybullet": replace(tracking, seed=5).on("pybullet", *seen),
        "marker_tracking by effort on pybullet": replace(tracking, without=("parameters",)).on("pybullet", by_effort),
        "identify_load on pybullet": Run("identify_load", ("duration:=2.0",)).on("pybullet", quick=True),
        "polish on mujoco": Run("polish", ("duration:=3.0",)).on("mujoco"),
        "ur5e_hand_guidance on mujoco": Run("ur5e_hand_guidance", ("duration:=0.5",)).on("mujoco", quick=True),
    }


RUNS = _runs()
"""All runs by name, which contains the experiment, its changes and the engine."""


def digests(run: Run) -> dict[str, Any]:
    """Make a run, and return its `state_sha256` and the `topics` of its bag, as read by bag_digest.read.

    Raises:
        RuntimeError: the run failed.
    """
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        options = ["--seed", str(run.seed), "--runs", str(root / "runs"), "--quiet", "--no-figures"]
        code, output = command("run", _experiment(run, root), *run.overrides, *options)
        if code:
            raise RuntimeError(f"{run.experiment} {' '.join(run.overrides)} ended with exit code {code}: {output}")
        folder = root / "runs" / "latest"
        (bag,) = folder.glob("*.bag")
        state = yaml.safe_load((folder / "run.yaml").read_text())["state_sha256"]
        return {"state_sha256": state, "topics": bag_digest.read(bag)}


def _experiment(run: Run, folder: Path) -> str:
    """Return the argument of the command for the experiment; if sections are left out, the path of a modified copy."""
    if run.experiment.endswith(".yaml"):
        return str(ROOT / run.experiment)
    if not run.without:
        return run.experiment
    path = Path(rospkg.RosPack().get_path("hric_experiments")) / "config" / "experiments" / f"{run.experiment}.yaml"
    content = {key: value for key, value in yaml.safe_load(path.read_text()).items() if key not in run.without}
    own = folder / path.name
    own.write_text(yaml.safe_dump(content, sort_keys=False))
    return str(own)


def command(name: str, *arguments: str) -> tuple[int, str]:
    """Run a command of `hric` in this process; return its exit code and output."""
    node = Path(rospkg.RosPack().get_path("hric_experiments")) / "nodes" / name
    before, printed = sys.argv, io.StringIO()
    sys.argv = [str(node), *arguments]
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            runpy.run_path(str(node), run_name="__main__")
    except SystemExit as end:
        return int(end.code or 0), printed.getvalue()
    finally:
        sys.argv = before
    return 0, printed.getvalue()


@functools.cache
def environment() -> dict[str, Any]:
    """Return processor and library versions; if they equal those of the list, results must be bitwise equal."""
    info = dict(line.split(":", 1) for line in Path("/proc/cpuinfo").read_text().split("\n\n")[0].splitlines())
    known = {key.strip(): value.strip() for key, value in info.items()}
    flags = set(known.get("flags", "").split())
    processor = [known.get(key, "") for key in ("vendor_id", "model name", "cpu family", "model")]
    libraries = {"python": platform.python_version(), "libc": " ".join(platform.libc_ver())}
    libraries |= {name: metadata.version(name) for name in DISTRIBUTIONS}
    libraries |= {name: _told("dpkg-query", "-W", "-f", "${Version}", name) for name in DEBIAN}
    libraries["cc"] = _told("cc", "-dumpfullversion")
    features = [name for name in FEATURES if name in flags]
    return {"processor": ", ".join(processor), "features": features, "libraries": libraries}


def _told(*command: str) -> str:
    """Return the output of a program; empty if it is missing or fails."""
    if shutil.which(command[0]) is None:
        return ""
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


@functools.cache
def listed() -> dict[str, Any]:
    """Return the content of headless_hashes.json."""
    content: dict[str, Any] = json.loads(LIST.read_text())
    return content


def differences(name: str, *, exact: bool | None = None) -> list[str]:
    """Make a run, and return its differences from the list, the earliest first; empty: no difference.

    Args:
        name: name of the run.
        exact: compare bitwise, else within the tolerance; None: bitwise if processor and libraries are as listed.
    """
    if exact is None:
        exact = environment() == listed()["environment"]
    if not exact and name in CHATTERING:
        return []
    wanted, found = listed()["runs"][name], digests(RUNS[name])
    mismatches = bag_digest.compare(wanted["topics"], found["topics"], exact=exact)
    told = [f"{name}: {mismatch.text}" for mismatch in mismatches]
    if exact and wanted["state_sha256"] != found["state_sha256"]:
        told.append(f"{name}: state_sha256 was {wanted['state_sha256']}, is {found['state_sha256']}")
    return told


def write(names: list[str]) -> None:
    """Make runs and write their results to the list; other entries must be of the same processor and libraries."""
    runs: dict[str, Any] = {}
    if names != list(RUNS):
        if environment() != listed()["environment"]:
            raise SystemExit("the list was made with another processor or libraries: write all of it, without names")
        runs = {name: run for name, run in listed()["runs"].items() if name in RUNS}
    for name in names:
        found = digests(RUNS[name])
        topics = {topic: bag_digest.describe(values) for topic, values in sorted(found["topics"].items())}
        runs[name] = {"state_sha256": found["state_sha256"], "topics": topics}
        print(f"{name}: {found['state_sha256'][:16]}, {len(topics)} topics", flush=True)
    content = {
        "made_by": "python3 tests/headless_hashes.py --write",
        "environment": environment(),
        "left_out": bag_digest.LEFT_OUT,
        "runs": {name: runs[name] for name in RUNS if name in runs},
    }
    LIST.write_text("\n".join(_lines(content)) + "\n")


def _lines(value: Any, depth: int = 0) -> Iterator[str]:
    """Yield the lines of the list as JSON, one line per field of a topic, so that its changes are readable."""
    if not isinstance(value, dict) or "count" in value:
        yield json.dumps(value)
        return
    yield "{"
    for number, (key, item) in enumerate(value.items(), 1):
        first, *rest = _lines(item, depth + 1)
        comma = "," if number < len(value) else ""
        lines = [f"{' ' * (depth + 1)}{json.dumps(key)}: {first}", *rest]
        yield from lines[:-1]
        yield lines[-1] + comma
    yield " " * depth + "}"


def main() -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(description="Compare headless runs with the committed list, or write it.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"names of runs (default: all): {'; '.join(RUNS)}")
    parser.add_argument("--write", action="store_true", help="write the results to the list")
    parser.add_argument("--tolerance", action="store_true", help="compare within the tolerance, not bitwise")
    given = parser.parse_args()
    if unknown := [name for name in given.names if name not in RUNS]:
        parser.error(f"no run {', '.join(unknown)}; valid: {'; '.join(RUNS)}")
    names = given.names or list(RUNS)
    if given.write:
        write(names)
        return 0
    failed = 0
    for name in names:
        told = differences(name, exact=False if given.tolerance else None)
        print("\n".join(told[:20]) or f"{name}: as listed", flush=True)
        failed += bool(told)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
