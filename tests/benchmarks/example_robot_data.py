"""Convert every robot of PyPI's example-robot-data to OpenSim, check and simulate the models, and write
docs/example_robot_data.md.

    python tests/benchmarks/example_robot_data.py                # installs the package into a throw-away folder (130 MB to download)
    python tests/benchmarks/example_robot_data.py --data FOLDER  # uses an installed package

Each robot is converted in a separate process, so that a crash becomes a row of the table. If the converter refuses a
robot with its default options, combinations of the options that it suggests are tried, the smallest combinations
first, and the table shows which were needed.
"""  # noqa: E501

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/example_robot_data.md"
PACKAGE = "example-robot-data==6.0.0"
OFFERS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("--names rename", {"names": "rename"}),
    ("--inertia repair", {"inertia": "repair"}),
    ("--no-meshes", {"meshes": False}),
)
STATES, SEED = 100, 0
RIGID = ("frames", "mass matrix", "gravity", "inverse dynamics")
RELATIVE = "mass matrix / inertia"
SHOWN = 400
"""Maximum length of a refusal on the page [characters]; some refusals list every joint."""
FORWARD, RUNS = 0.5, 3
"""Simulated time of a forward run [s], and number of runs each with and without friction, whose median is used."""
SLOWEST, SHARE = 0.2, 1.0 / 3.0
"""Bounds below which the page names a robot as slow: real-time factor, and its ratio to that without friction [1]."""
TIMEOUT = 900.0
"""Timeout of the process of one robot [s]."""


@dataclass
class Row:
    """Result of one robot.

    Attributes:
        name: path of its URDF below robots/.
        needed: options that it needed, as command-line arguments.
        refusal: message of the converter with all options; empty if it passed.
        first: message of the converter with the default options; empty if these passed.
        freedom: number of coordinates of the model, without those of mimic joints.
        errors: largest error by compared quantity.
        convert_s, mesh_s, proof_s: wall times of conversion, mesh conversion and comparison [s].
        meshes: number of mesh files.
        forward, frictionless: real-time factors with default friction and without any, by processor time; 0 for a robot
            without joints.
        transitions: smallest and largest transition velocity of friction [rad/s or m/s]; empty without friction.
    """

    name: str
    needed: list[str] = field(default_factory=list)
    refusal: str = ""
    first: str = ""
    freedom: int = 0
    errors: dict[str, float] = field(default_factory=dict)
    convert_s: float = 0.0
    mesh_s: float = 0.0
    proof_s: float = 0.0
    meshes: int = 0
    forward: float = 0.0
    frictionless: float = 0.0
    transitions: list[float] = field(default_factory=list)


def robots(data: Path) -> list[Path]:
    """Return all URDF files of the installed package."""
    return sorted(data.rglob("*.urdf"))


def install(folder: Path) -> None:
    """Install the package into a folder, without its dependencies."""
    words = [
        "--disable-pip-version-check",
        "--progress-bar",
        "off",
        "--quiet",
        "--no-deps",
        "--target",
        str(folder),
        PACKAGE,
    ]
    subprocess.run([sys.executable, "-m", "pip", "install", *words], check=True, timeout=900)


def try_robot(path: Path, row: Row) -> Row:
    """Convert and simulate one robot in this process, which a crash would end."""
    import opensim

    from hric_core.errors import HricError

    opensim.Logger.setLevelString("Error")
    offers = itertools.chain.from_iterable(itertools.combinations(OFFERS, count) for count in range(len(OFFERS) + 1))
    for chosen in offers:
        try:
            _convert(path, row, {key: value for _, options in chosen for key, value in options.items()})
        except HricError as error:
            row.refusal = str(error)
            row.first = row.first or row.refusal
            continue
        row.needed, row.refusal = [words for words, _ in chosen], ""
        _run_forward(path, row, {key: value for _, options in chosen for key, value in options.items()})
        break
    return row


def _run_forward(path: Path, row: Row, chosen: dict[str, Any]) -> None:
    """Simulate from the default pose with OpenSim's default integrator, alternating with and without friction."""
    import opensim

    import urdf_to_osim
    from urdf_to_osim.cli import read_description
    from urdf_to_osim.proof import forward

    forward.LIMIT = TIMEOUT
    models, text = {}, read_description(str(path))
    for friction in ("coulomb", "none"):
        options = urdf_to_osim.Options(**{"folder": str(path.parent), **chosen, "meshes": False, "friction": friction})
        conversion = urdf_to_osim.convert(text, options)
        models[friction] = conversion.model, opensim.State(conversion.model.initSystem())
        if velocities := conversion.plan.friction_velocities.values():
            row.transitions = [min(velocities), max(velocities)]
    if not models["none"][1].getNQ():
        return
    factors: dict[str, list[float]] = {"coulomb": [], "none": []}
    for _ in range(RUNS):
        for friction, found in factors.items():
            found.append(forward.run_forward(*models[friction], FORWARD).real_time_factor)
    row.forward, row.frictionless = (statistics.median(factors[friction]) for friction in ("coulomb", "none"))


def _convert(path: Path, row: Row, chosen: dict[str, Any]) -> None:
    import urdf_to_osim
    from urdf_to_osim.cli import read_description

    options = urdf_to_osim.Options(folder=str(path.parent), **chosen)
    text = read_description(str(path))
    started = time.perf_counter()
    conversion = urdf_to_osim.convert(text, options)
    row.convert_s = time.perf_counter() - started
    with tempfile.TemporaryDirectory() as folder:
        written = urdf_to_osim.write(conversion, Path(folder) / "robot.osim", cache=Path(folder) / "cache")
        proof = urdf_to_osim.prove(written.path, text, options, STATES, SEED)
    if not proof.passed:
        from hric_core.errors import DescriptionError

        raise DescriptionError(
            f"the proof failed: {', '.join(f'{name} {proof.errors[name]:.1e}' for name in proof.failed)}"
        )
    row.freedom = (
        sum(len(joint.coordinates) for joint in conversion.joints.values())
        - conversion.model.getConstraintSet().getSize()
    )
    row.errors, row.proof_s = proof.errors, proof.seconds
    row.meshes, row.mesh_s = len(written.meshes), written.mesh_seconds


def run_all(data: Path) -> Iterator[Row]:
    """Yield the result of each robot, converted in a separate process."""
    with tempfile.TemporaryDirectory() as folder:
        share = _ros_package(data, Path(folder))
        environment = os.environ | {"ROS_PACKAGE_PATH": folder, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        for path in robots(data):
            row = _run_one(path, environment)
            # Paths in messages are relative to the package.
            row.refusal, row.first = (
                text.replace(f"{share}/", "").replace(f"{folder}/", "") for text in (row.refusal, row.first)
            )
            yield row


def _ros_package(data: Path, folder: Path) -> Path:
    """Return a ROS package with the data, under the package name in the mesh addresses.

    That is the name of the data's folder; the package.xml of the data has a different one.
    """
    (share,) = (path.parent for path in data.rglob("package.xml"))
    package = folder / share.name
    package.mkdir()
    (package / "robots").symlink_to((share / "robots").resolve())
    (package / "package.xml").write_text(f"<package><name>{share.name}</name></package>")
    return share


def _run_one(path: Path, environment: dict[str, str]) -> Row:
    name = str(path).split("/robots/", 1)[-1]
    words = [sys.executable, __file__, "--one", str(path), "--name", name]
    try:
        result = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        refusal = f"not done within {TIMEOUT:.0f} s"
        return Row(name, refusal=refusal, first=refusal)
    if result.returncode == 0:
        return Row(**json.loads(result.stdout.splitlines()[-1]))
    refusal = f"the process ended with {result.returncode}: {(result.stderr.splitlines() or ['no word'])[-1]}"
    return Row(name, refusal=refusal, first=refusal)


def page(rows: Sequence[Row]) -> str:
    """Return the page as Markdown."""
    passed = [row for row in rows if not row.refusal]
    plain = [row for row in passed if not row.needed]
    head = f"""# The converter over example-robot-data

This page shows how well `urdf_to_osim` converts public robot descriptions to OpenSim models: every URDF of the PyPI package `{PACKAGE}` is converted, the written model
is read back, and its dynamics are compared with the description at {STATES} random states (seed {SEED}). **{len(passed)} of {len(rows)} pass**, {len(plain)} of them with the default options, {len(passed) - len(plain)} with options
that the converter suggests when it refuses a description. `python tests/benchmarks/example_robot_data.py` makes this page.

Errors are the largest ones of all states, relative to the largest value if that is above 1; the tolerance is 1e-9. "Forces" is the largest error of the forces that are compared
with closed-form formulas (damping, friction, joint stops, mimic couplers, actuators). Times are of one run on two busy shared cores; meshes were converted from their source files,
not taken from the cache. The workspace uses the package for this check only.

| URDF | DoF | result | frames | mass matrix | gravity | inverse dynamics | forces | conversion [s] | meshes | mesh conversion [s] | proof [s] |
|---|---|---|---|---|---|---|---|---|---|---|---|
"""  # noqa: E501
    return head + "\n".join(map(_line, rows)) + "\n" + _forward_page(passed) + _explained(rows)


def _forward_page(rows: Sequence[Row]) -> str:
    """Return the section on forward simulation as Markdown."""
    runs = [row for row in rows if row.forward]
    slow, far = (
        [row.name for row in runs if row.forward < bound(row)]
        for bound in (lambda row: SLOWEST, lambda row: SHARE * row.frictionless)
    )
    return (
        f"""
## Forward simulation

Speed of a forward simulation of each converted robot: {FORWARD} s without controls, from its default pose at rest, with OpenSim's default integrator and accuracy and the default
options of the converter. Real-time factors (simulated time per processor time) are medians of {RUNS} runs, with the default friction and without any. v is the range of the transition
velocities in the friction law -f tanh(dq/v); without v the description has no friction, and both models are the same.

- Real-time factor below {SLOWEST}: {_names(slow)}
- Below a third of the factor without friction: {_names(far)}
- Both: {_names([name for name in slow if name in far])}

| URDF | real-time factor | without friction | ratio | v [rad/s or m/s] |
|---|---|---|---|---|
"""  # noqa: E501
        + "\n".join(map(_forward_line, runs))
        + "\n"
    )


def _names(found: Sequence[str]) -> str:
    return ", ".join(name.rpartition("/")[2] for name in found) or "none"


def _forward_line(row: Row) -> str:
    v = f"{row.transitions[0]:.2g} to {row.transitions[1]:.2g}" if row.transitions else ""
    return f"| {row.name} | {row.forward:.2g} | {row.frictionless:.2g} | {row.forward / row.frictionless:.2f} | {v} |"


def _line(row: Row) -> str:
    if row.refusal:
        return f"| {row.name} | | refused | | | | | | | | | |"
    forces = [error for name, error in row.errors.items() if name not in (*RIGID, RELATIVE)]
    errors = [row.errors.get(name) for name in RIGID] + [max(forces) if forces else None]
    shown = " | ".join("" if error is None else f"{error:.0e}" for error in errors)
    result = f"passes, `{' '.join(row.needed)}`" if row.needed else "passes"
    times = f"{row.convert_s:.2f} | {row.meshes} | {row.mesh_s:.2f} | {row.proof_s:.2f}"
    return f"| {row.name} | {row.freedom} | {result} | {shown} | {times} |"


def _explained(rows: Sequence[Row]) -> str:
    """Return the sections with messages on robots that were refused or needed options, as Markdown."""
    text = ""
    for title, said in (
        (
            f"Refused, even with {', '.join(f'`{words}`' for words, _ in OFFERS)}",
            {row.name: row.refusal for row in rows if row.refusal},
        ),
        (
            "Passed with an option; message of the converter with the default options",
            {row.name: row.first for row in rows if row.needed and not row.refusal},
        ),
    ):
        if said:
            text += f"\n## {title}\n\n" + "".join(
                f"- {name}: {textwrap.shorten(words, SHOWN)}\n" for name, words in said.items()
            )
    return text


def main(words: Sequence[str]) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder with the installed package")
    parser.add_argument("--output", type=Path, default=PAGE)
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--name", default="", help=argparse.SUPPRESS)
    given = parser.parse_args(words)
    if given.one:
        print(json.dumps(asdict(try_robot(given.one, Row(given.name)))))
        return
    with tempfile.TemporaryDirectory() as folder:
        if given.data is None:
            install(Path(folder))
        rows = []
        for row in run_all(given.data or Path(folder)):
            rows.append(row)
            print(f"{len(rows):3d} {row.name}: {row.refusal or 'passes ' + ' '.join(row.needed)}", flush=True)
    given.output.write_text(page(rows))


if __name__ == "__main__":
    main(sys.argv[1:])
