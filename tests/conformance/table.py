"""All descriptions of the conformance tests on all engines; writes docs/conformance.md.

    python tests/conformance/table.py            # needs what scripts/setup --with checks installs

Each public robot has a process of its own, so that a crash is a row of the table like any other.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from conformance_measures import (
    ENGINES,
    INSTANT,
    SKIN,
    acceleration_error,
    contacts_at_rest,
    held,
    motion_error,
    surely,
)
from conformance_oracle import Oracle
from conformance_robots import CHAINS, MIMICS, public_folder, public_package, without_losses

PAGE = Path(__file__).resolve().parents[2] / "docs/conformance.md"
STATES, STEPS = 20, 50
"""Of each robot and engine: random states for the acceleration, and steps of 1 ms of a motion for the laws."""
TIMEOUT = 900.0
"""For one robot [s]."""
NONE = "-"
HEAD = f"""# One description on three engines

A description means the same on PyBullet, MuJoCo and OpenSim. This page says what, and shows it beside pinocchio, a rigid-body library that none of the engines uses.

## What holds on every engine

- **Joints that mimic others** (`<mimic>`) obey q = multiplier * q_leader + offset from the start and in every step, also in chains, for sliding joints, across branches, beyond the
  follower's own range, and with multiplier 0. The dynamics are those of the constrained robot: with q = J z + c, J'(M + B) J z'' = J'(tau - h). Drives, brakes, stops, friction, contact, wrenches
  and bushings on one joint act on all that hang on it; a follower's stop stops its leader. `Plant.mass_matrix` and the effective mass of penalty contact have both. Where the robot is put, only the
  leader's position counts. A follower with a `<transmission>` is refused: nothing can drive it by itself.
- **Neighbours** never touch: links that are fixed to each other over any number of fixed joints, and all links of two such groups that one moving joint joins. The list is computed from the description
  (`hric_control.urdf.Robot.neighbours`); no engine's own rule decides. All other links of the robot that overlap do touch, unless `collision_masks` lists them; a link without a shape between two others does
  not make them neighbours.
- **Closed chains** are not URDF: a link with two parents is refused. A chain that was cut moves as the tree that it is, its cut ends hang free. Where the loop keeps angles in a fixed ratio, as a parallelogram
  does, `<mimic>` closes it exactly; else a bushing between the two cut ends does (`Plant.connect`), as a spring: 0.4 mm of play in a parallelogram of 3 kg at 20 kN/m.
- **Sliding joints and joints without end** are as in the description; positions of the latter count turns and do not wrap.
- A joint whose range has no width is held by its stops.

## What an engine cannot

- PyBullet keeps 1 mm around the convex hull of each mesh: two of them touch up to {1e3 * SKIN:.0f} mm early. Boxes, spheres, cylinders and capsules have no such skin.
- MuJoCo shares contact between a follower and its leader by its equality constraint, to a ten-thousandth of the acceleration; what this leaves of the law is taken out at the end of the step.
- PyBullet shares it by a gear, to the accuracy of its iteration; the end of the step is on the law.

## Measured

Acceleration: largest difference of one step of {1e6 * INSTANT:.0f} us to pinocchio in {STATES} random states with random efforts, relative to the largest acceleration of the state; descriptions of others without
their damping, which at light links is stiffer than any step (damping has tests of its own). Law: largest distance of a link from where the laws have it [rad or m], over {STEPS} steps of 1 ms. Contacts: pairs of links that overlap where all joints are at zero, the
same on all engines that load the robot; "+ n": pairs that only PyBullet's skins let touch; "differ": the engines disagree. None are neighbours. "-": nothing to measure (no joint mimics; or a joint is held
by a range of no width). "refused": see below. Made by `python tests/conformance/table.py`; the tests in `tests/conformance` check a part of it.

"""  # noqa: E501


@dataclass
class Row:
    """Figures of one robot, by engine; a text where there is none.

    Attributes:
        name: of the robot.
        joints, followers: how many move, and how many of them mimic others.
        acceleration: largest relative error of one-step accelerations.
        law: largest distance from the laws [rad or m].
        contacts: pairs of links that overlap at rest, and on PyBullet those of them by its skins alone.
        refusals: sentences of engines that refuse it.
    """

    name: str
    joints: int = 0
    followers: int = 0
    acceleration: dict[str, str] = field(default_factory=dict)
    law: dict[str, str] = field(default_factory=dict)
    contacts: str = NONE
    refusals: list[str] = field(default_factory=list)


def measure(name: str, urdf: str) -> Row:
    """A robot on all engines."""
    from hric_control.errors import HricError

    row = Row(name)
    try:
        oracle = Oracle(urdf)
    except (KeyError, ValueError) as error:
        row.refusals.append(f"pinocchio or the test: {error}")
        return row
    row.joints, row.followers = len(oracle.names), len(oracle.names) - len(oracle.independent)
    found = {}
    for engine in ENGINES:
        try:
            row.acceleration[engine] = NONE if held(oracle) else f"{acceleration_error(engine, urdf, STATES):.0e}"
            if row.followers:
                row.law[engine] = f"{motion_error(engine, without_losses(urdf), STEPS):.0e}"
            found[engine] = contacts_at_rest(engine, urdf)
        except HricError as error:
            row.refusals.append(f"{engine}: {error}")
    row.contacts = compare(found)
    return row


def compare(found: dict[str, dict[tuple[str, str], float]]) -> str:
    """Contacts of the engines that loaded the robot, in words."""
    if not found:
        return NONE
    pairs = {engine: surely(contacts, SKIN if engine == "PyBullet" else 0.0) for engine, contacts in found.items()}
    exact = [pairs[engine] for engine in pairs if engine != "PyBullet"]
    shallow = surely(found.get("PyBullet", {})) - pairs.get("PyBullet", set())
    if any(other != exact[0] for other in exact[1:]) or (exact and not pairs.get("PyBullet", set()) <= exact[0]):
        return "differ: " + ", ".join(f"{engine} {len(of)}" for engine, of in pairs.items())
    alone = len(shallow - exact[0]) if exact else 0
    return f"{len(exact[0] if exact else pairs['PyBullet'])}" + (f" + {alone}" if alone else "")


def measure_apart(path: Path) -> Row:
    """A public robot in a process of its own."""
    words = [sys.executable, __file__, "--one", str(path)]
    try:
        result = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        return Row(path.name, refusals=[f"not done within {TIMEOUT:.0f} s"])
    if result.returncode:
        return Row(path.name, refusals=[f"the process ended with {result.returncode}: {result.stderr[-200:]}"])
    return Row(**json.loads(result.stdout.splitlines()[-1]))


def line(row: Row) -> str:
    """A row of Markdown."""
    if not row.acceleration:
        return f"| {row.name} | {row.joints} | {row.followers} | refused |" + " |" * 6
    cells = [row.acceleration.get(engine, "refused") for engine in ENGINES]
    cells += [row.law.get(engine, NONE) for engine in ENGINES]
    return f"| {row.name} | {row.joints} | {row.followers} | " + " | ".join([*cells, row.contacts]) + " |"


def page(rows: Sequence[Row]) -> str:
    """The page as Markdown."""
    columns = [*(f"acceleration, {engine}" for engine in ENGINES), *(f"law, {engine}" for engine in ENGINES)]
    head = "| robot | joints | that mimic | " + " | ".join(columns) + " | contacts |\n" + "|---" * 10 + "|\n"
    refused = "".join(f"- `{row.name}`: {text}\n" for row in rows for text in row.refusals)
    return HEAD + head + "\n".join(map(line, rows)) + f"\n\n## Refused\n\n{refused}"


def main() -> None:
    """Measure all, or the one that is named."""
    with tempfile.TemporaryDirectory() as folder, public_package(Path(folder)):
        if sys.argv[1:2] == ["--one"]:
            path = Path(sys.argv[2])
            print(json.dumps(asdict(measure(path.name, path.read_text(encoding="utf-8")))))
            return
        rows = [measure(name, urdf) for name, urdf in (CHAINS | MIMICS).items()]
        rows += [measure_apart(path) for path in sorted(public_folder().rglob("*.urdf"))]
        text = page(rows).replace(folder, "")
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
