"""All descriptions of the conformance tests on all engines; writes docs/conformance.md.

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
"""Of each robot and engine: random states for the acceleration, and steps of 1 ms of a motion for the laws."""
NONE = "-"
HEAD = f"""# One description on three engines

A robot description has the same meaning on PyBullet, MuJoCo and OpenSim. This page lists what is the same, and compares the engines with pinocchio, a rigid-body library that none of them uses.

## What holds on every engine

- **Joints that mimic others** (`<mimic>`) obey q = multiplier * q_leader + offset from the start and in every step, also in chains, for prismatic joints, across branches, beyond the
  follower's own range, and with multiplier 0. The dynamics are those of the constrained robot: with q = J z + c, J'(M + B) J z'' = J'(tau - h). Drives, brakes, stops, friction, contact, wrenches
  and bushings on one joint act on all joints that are coupled to it; a follower's stop stops its leader. `Plant.mass_matrix` and the effective mass of penalty contact include leader and followers. When
  the robot's position is set, only the leader's position counts. A follower with a `<transmission>` is refused: nothing can drive it by itself.
- **Neighbours** never touch. Neighbours are links that are connected by any number of fixed joints, and all links of two such groups that are connected by one moving joint. The list is computed from the description
  (`hric_core.urdf.Robot.neighbours`); no engine applies a rule of its own. All other links of the robot that overlap do touch, unless `collision_masks` lists them; a link without a shape between two others does
  not make them neighbours.
- **Closed chains** are not URDF: a link with two parents is refused. A chain that was cut moves as a tree whose cut ends hang free. If the loop keeps angles in a fixed ratio, as a parallelogram
  does, `<mimic>` closes it exactly; otherwise a bushing between the two cut ends closes it as a spring (`Plant.connect`): 0.4 mm of play in a parallelogram of 3 kg at 20 kN/m.
- **Prismatic and continuous joints** are as in the description; the position of a continuous joint counts full turns and does not wrap.
- A joint whose lower and upper limit are equal is held by its stops.

## Limits of single engines

- PyBullet adds a margin of 1 mm around the convex hull of each mesh. The plant gives it hulls that are smaller by this margin: their sides are where they should be, their corners are round (the corner of a box touches 0.7 mm
  late). A mesh thinner than 4 mm keeps a part of this margin.
- MuJoCo distributes contact between a follower and its leader by its equality constraint, to a ten-thousandth of the acceleration. The rest of the deviation from the mimic law is removed at the end of the step.
- PyBullet distributes it by a gear constraint, to the accuracy of its solver iterations; at the end of the step the joints obey the mimic law.

## Measured

Acceleration: largest difference between the engine and pinocchio in one step of {1e6 * INSTANT:.0f} us, over {STATES} random states with random efforts, relative to the largest acceleration of the state. Public
descriptions are taken without their damping, which at light links is stiffer than any step can resolve (damping has tests of its own). 0: the speeds are equal
to the last bit. Law: largest distance of a link from the position that the mimic laws give [rad or m], over {STEPS} steps of 1 ms. Contacts: number of pairs of links that overlap by more than {1e6 * TOUCHING:.0f} um when all joints are at zero; it is one
number if all engines that load the robot agree; "n deeper": they agree on overlaps of more than {1e3 * ROUND:.0f} mm. None of these pairs are neighbours. "-": nothing to measure (no joint mimics another, or a joint is held
by equal limits). Made by `python tests/conformance/table.py`; the tests in `tests/conformance` check a part of it.

"""  # noqa: E501


@dataclass
class Row:
    """Figures of one robot, by engine; a text where there is none.

    Attributes:
        name: of the robot.
        joints, followers: how many move, and how many of them mimic others.
        acceleration: largest relative error of one-step accelerations.
        law: largest distance from the laws [rad or m].
        contacts: pairs of links that overlap at rest.
        refusals: sentences of engines that refuse it.
    """

    name: str
    joints: int
    followers: int
    acceleration: dict[str, str] = field(default_factory=dict)
    law: dict[str, str] = field(default_factory=dict)
    contacts: str = NONE
    refusals: list[str] = field(default_factory=list)


def measure(name: str, urdf: str) -> Row:
    """A robot on all engines."""
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
    """Number of contacts on which the engines that loaded the robot agree, or that they do not."""
    pairs = [overlapping(contacts) for contacts in found.values()]
    if not pairs:
        return NONE
    if all(other == pairs[0] for other in pairs):
        return str(len(pairs[0]))
    deep = [overlapping(contacts, ROUND) for contacts in found.values()]
    counts = ", ".join(f"{engine} {len(of)}" for engine, of in zip(found, pairs, strict=True))
    return f"{counts}; {len(deep[0])} deeper" if all(other == deep[0] for other in deep) else f"differ: {counts}"


def line(row: Row) -> str:
    """A row of Markdown."""
    cells = [row.acceleration.get(engine, "refused") for engine in ENGINES]
    cells += [row.law.get(engine, NONE) for engine in ENGINES]
    return f"| {row.name} | {row.joints} | {row.followers} | " + " | ".join([*cells, row.contacts]) + " |"


def page(rows: Sequence[Row]) -> str:
    """The page as Markdown."""
    columns = [*(f"acceleration, {engine}" for engine in ENGINES), *(f"law, {engine}" for engine in ENGINES)]
    head = "| robot | joints | mimic joints | " + " | ".join(columns) + " | contacts |\n" + "|---" * 10 + "|\n"
    refused = "".join(f"- `{row.name}` is refused: {text}\n" for row in rows for text in row.refusals)
    return HEAD + head + "\n".join(map(line, rows)) + f"\n\n{refused}".rstrip() + "\n"


def main() -> None:
    """Measure all, and write the page."""
    with tempfile.TemporaryDirectory() as folder, public_package(Path(folder)):
        robots = CHAINS | MIMICS | {name: public(name) for name in PUBLIC}
        text = page([measure(name, urdf) for name, urdf in robots.items()])
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
