"""Command line of `rosrun panda_description inertials`: Steiner's theorem and physical sense of the inertial sets."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace

from panda_description.inertia import LinkInertia, com_to_origin, judge, origin_to_com
from panda_description.parameters import INERTIAL_SETS, inertials

_STEINER = {"apply": com_to_origin, "undo": origin_to_com}


def parser() -> argparse.ArgumentParser:
    """The command's arguments."""
    made = argparse.ArgumentParser(
        prog="rosrun panda_description inertials",
        description="Prints per link: mass, inertia tensor, principal moments, triangle margin (smaller two less the largest), definiteness.",
    )
    made.add_argument("--set", choices=INERTIAL_SETS, default="barycentric", help="inertial set (default: %(default)s)")
    made.add_argument(
        "--steiner",
        choices=tuple(_STEINER),
        help="move each tensor first: apply adds m (q'q E - q q') (centre of mass to link origin, thesis Eq. 1), undo subtracts it (Eq. 2)",
    )
    return made


def moved(links: dict[str, LinkInertia], steiner: str | None) -> dict[str, LinkInertia]:
    """The links with Steiner's term added (`apply`), subtracted (`undo`) or as they are (None)."""
    if steiner is None:
        return links
    move = _STEINER[steiner]
    return {part: replace(link, inertia=move(link.inertia, link.mass, link.com)) for part, link in links.items()}


def table(links: dict[str, LinkInertia]) -> str:
    """One line per link: mass [kg], centre of mass [m], tensor and moments [kg m^2], triangle margin [kg m^2], definiteness."""
    columns = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "e1", "e2", "e3", "margin")
    head = f"{'part':7}{'mass':>10}" + "".join(f"{name:>11}" for name in columns) + "  verdict"
    rows = [head]
    for part, link in links.items():
        verdict, i = judge(link.inertia), link.inertia
        numbers = (i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2], *verdict.moments, verdict.triangle_margin)
        text = " and ".join(verdict.reasons()) or "positive definite, physical"
        rows.append(f"{part:7}{link.mass:10.6f}" + "".join(f"{float(number):11.6f}" for number in numbers) + f"  {text}")
    return "\n".join(rows)


def run(words: Sequence[str]) -> str:
    """What the command prints."""
    given = parser().parse_args(words)
    point = {None: "as the set has them", "apply": "Steiner's term added", "undo": "Steiner's term subtracted"}[given.steiner]
    title = f"inertials '{given.set}', {point}; mass [kg], tensor, principal moments e1..e3 and margin e1 + e2 - e3 [kg m^2]"
    return f"{title}\n{table(moved(inertials(given.set), given.steiner))}"
