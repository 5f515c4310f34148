"""Measure all robot descriptions of the conformance tests on all engines, and write docs/conformance.md.

python tests/conformance/table.py            # needs what scripts/setup --with checks installs
"""

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from conformance_measures import (
    ENGINES,
    INSTANT,
    ROUND,
    TOUCHING,
    acceleration_error,
    contacts_at_rest,
    held,
    motion_error,
    overlapping,
)
from conformance_oracle import Oracle
from conformance_robots import CHAINS, MIMICS, PUBLIC, public, public_package, without_losses

from hric_core.errors import HricError

PAGE = Path(__file__).resolve().parents[2] / "docs/conformance.md"
STATES, STEPS = 10, 30
"""Per robot and engine: number of random states for the accelerations, and of steps of 1 ms for the mimic laws."""
NONE = "-"
HEAD = f"""# One description on three engines

A robot description (URDF) is simulated in the same way on PyBullet, MuJoCo and OpenSim. This page lists what is the same, and compares the engines with pinocchio, a rigid-body library that none of them uses.

## The same on every engine

- **Joints that mimic others** (`<mimic>`) obey q = multiplier * q_leader + offset from the start and in every step; this includes followers of followers, prismatic joints, joints on different branches, positions beyond the
  follower's own range, and a multiplier of 0. The dynamics are those of the constrained robot: with q = J z + c for independent coordinates z, J'(M + B) J z'' = J'(tau - h), where M is the mass matrix, B the rotor inertia, and h contains gravity and velocity terms. Drives, brakes, stops, friction, contact, wrenches
  and bushings that act on one joint act on all joints coupled to it; a follower's stop stops its leader. `Plant.mass_matrix` and the effective mass of penalty contact include the coupling. When
  the robot's position is set, only the leader's position is used. A follower with a `<transmission>` is refused, since it cannot be driven independently.
- **Neighbouring links** never collide. Neighbours are all links that are rigidly connected by fixed joints, and all links of two such rigid groups that are connected by one moving joint. The list is computed from the description
  (`hric_core.urdf.Robot.neighbours`); it replaces the rules of the engines. All other links of the robot that overlap do collide, unless `collision_masks` lists them; this includes two links with a link without
  collision shape between them.
- **Closed chains** cannot be described by URDF: a link with two parents is refused. Cut the loop at one joint; the description is then a tree with two loose ends. If the loop keeps joint angles in a fixed ratio, as a parallelogram
  does, `<mimic>` closes it exactly; otherwise a bushing (a spring in all directions) between the two loose ends closes it approximately (`Plant.connect`): with 20 kN/m, the ends of a parallelogram of 3 kg separate by 0.4 mm.
- **Prismatic and continuous joints** are as in the description; the position of a continuous joint counts full turns and does not wrap.
- A joint whose lower and upper limit are equal is held at this position by its stops.

## Deviations of single engines

- PyBullet adds a margin of 1 mm around the convex hull of each mesh. The plant passes hulls that are smaller by this margin: their sides are where they should be, their corners are round (the corner of a box touches 0.7 mm
  late). A mesh thinner than 4 mm keeps a part of this margin.
- On MuJoCo, an equality constraint transfers contact forces between a follower and its leader, with an error of 1e-4 of the acceleration. The remaining deviation from the mimic law is removed at the end of the step.
- On PyBullet, a gear constraint transfers them, with the accuracy of the solver iterations; at the end of the step the joints obey the mimic law.

## Measured

`python tests/conformance/table.py` makes this table; the tests in `tests/conformance` check a part of it. Its columns:

- Acceleration: largest difference of a joint acceleration between the engine and pinocchio in one step of {1e6 * INSTANT:.0f} us, over {STATES} random states with random efforts, relative to the largest acceleration of the state. 0: the velocities are equal
  to the last bit. Damping of the public descriptions is left out, since for light links it is stiffer than any step can resolve (other tests check damping).
- Law: largest deviation of a joint from the position that the mimic law gives [rad or m], over {STEPS} steps of 1 ms.
- Contacts: number of pairs of links that overlap by more than {1e6 * TOUCHING:.0f} um when all joints are at zero. A single number means that all engines that load the robot agree; "n deeper" means that they agree only on the n overlaps of more than {1e3 * ROUND:.0f} mm. None of these pairs are neighbours.
- "-": nothing to measure (no joint mimics another, or a joint is held by equal limits).

"""  # noqa: E501


@dataclass
class Row:
    """Table row of one robot: its measured figures by engine, as text.

    Attributes:
        name: name of the robot.
        joints, followers: number of moving joints, and of those that mimic others.
        acceleration: largest relative error of one-step accelerations.
        law: largest deviation of a follower from its mimic law [rad or m].
        contacts: number of pairs of links that overlap when all joints are at zero.
        refusals: error messages of engines that refuse the robot.
    """

    name: str
    joints: int
    followers: int
    acceleration: dict[str, str] = field(default_factory=dict)
    law: dict[str, str] = field(default_factory=dict)
    contacts: str = NONE
    refusals: list[str] = field(default_factory=list)


def measure(name: str, urdf: str) -> Row:
    """Measure a robot on all engines."""
    oracle = Oracle(urdf)
    row = Row(name, len(oracle.names), len(oracle.names) - len(oracle.independent))
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
    """Return the number of overlapping pairs, as text; if the engines differ, the number of each engine."""
    pairs = [overlapping(contacts) for contacts in found.values()]
    if not pairs:
        return NONE
    if all(other == pairs[0] for other in pairs):
        return str(len(pairs[0]))
    deep = [overlapping(contacts, ROUND) for contacts in found.values()]
    counts = ", ".join(f"{engine} {len(of)}" for engine, of in zip(found, pairs, strict=True))
    return f"{counts}; {len(deep[0])} deeper" if all(other == deep[0] for other in deep) else f"differ: {counts}"


def line(row: Row) -> str:
    """Return the row in Markdown."""
    cells = [row.acceleration.get(engine, "refused") for engine in ENGINES]
    cells += [row.law.get(engine, NONE) for engine in ENGINES]
    return f"| {row.name} | {row.joints} | {row.followers} | " + " | ".join([*cells, row.contacts]) + " |"


def page(rows: Sequence[Row]) -> str:
    """Return the page in Markdown."""
    columns = [*(f"acceleration, {engine}" for engine in ENGINES), *(f"law, {engine}" for engine in ENGINES)]
    head = "| robot | joints | mimic joints | " + " | ".join(columns) + " | contacts |\n" + "|---" * 10 + "|\n"
    refused = "".join(f"- `{row.name}` is refused: {text}\n" for row in rows for text in row.refusals)
    return HEAD + head + "\n".join(map(line, rows)) + f"\n\n{refused}".rstrip() + "\n"


def main() -> None:
    """Measure all robots, and write the page."""
    with tempfile.TemporaryDirectory() as folder, public_package(Path(folder)):
        robots = CHAINS | MIMICS | {name: public(name) for name in PUBLIC}
        text = page([measure(name, urdf) for name, urdf in robots.items()])
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
