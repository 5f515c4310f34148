"""Sets of inertial parameters of the Panda, their physical consistency, and the command `inertials`."""

import argparse
from dataclasses import replace

import numpy as np

from hric_core.command import Argument, Command
from hric_core.errors import UnknownNameError
from hric_core.geometry import MassProperties, judge, steiner_term, tensor
from panda_description.parameters import PACKAGE, config

INERTIAL_SETS = ("barycentric", "fr3", "thesis")
_STEINER = {"apply": 1.0, "undo": -1.0}
"""Factor of Steiner's term (parallel-axis theorem): apply is eq. 1 of the thesis, undo eq. 2."""


def inertials(name: str = "barycentric") -> dict[str, MassProperties]:
    """Return mass, centre of mass and inertia of each part: link0 to link7, hand, finger (one of the two).

    Args:
        name: set of inertial parameters, `barycentric`, `fr3` or `thesis`.
    """
    if name not in INERTIAL_SETS:
        raise UnknownNameError("set of inertials", name, INERTIAL_SETS, PACKAGE)
    parts = _links("barycentric")
    if name == "fr3":
        return parts | _links("fr3")
    return parts if name == "barycentric" else parts | _thesis(parts)


def unphysical(name: str) -> dict[str, list[str]]:
    """Return the parts of an inertial set that are physically impossible, with the reasons."""
    verdicts = {part: judge(link.inertia).reasons() for part, link in inertials(name).items()}
    return {part: reasons for part, reasons in verdicts.items() if reasons}


def _links(name: str) -> dict[str, MassProperties]:
    return {part: _link_inertia(values) for part, values in config(f"inertials_{name}")["links"].items()}


def _link_inertia(values: dict[str, dict[str, float]]) -> MassProperties:
    com = values["com"]
    return MassProperties(float(values["mass"]), np.array([com["x"], com["y"], com["z"]]), tensor(**values["inertia"]))  # type: ignore[arg-type]


def _thesis(parts: dict[str, MassProperties]) -> dict[str, MassProperties]:
    """Return the parts that differ in the thesis's set, computed from `parts` as config/inertials_thesis.yaml says."""
    rule = config("inertials_thesis")
    changed = {}
    for part in rule["links"]:
        link = parts[part]
        overrides = rule["com_overrides"].get(part, {})
        com = np.array([overrides.get(axis, value) for axis, value in zip("xyz", link.com, strict=True)])
        changed[part] = MassProperties(link.mass, com, link.inertia + rule["steiner"] * steiner_term(link.mass, com))
    return changed


def moved(links: dict[str, MassProperties], steiner: str | None) -> dict[str, MassProperties]:
    """Return the links with Steiner's term added to the inertias (`apply`), subtracted (`undo`) or unchanged (None)."""
    if steiner is None:
        return links
    sign = _STEINER[steiner]
    return {
        part: replace(link, inertia=link.inertia + sign * steiner_term(link.mass, link.com))
        for part, link in links.items()
    }


def report(links: dict[str, MassProperties]) -> str:
    """Return a table of the links: mass [kg], inertia tensor, principal moments, triangle margin [kg m^2], verdict.

    Triangle margin: sum of the two smaller principal moments minus the largest; negative values are impossible.
    """
    columns = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "e1", "e2", "e3", "margin")
    rows = [f"{'part':7}{'mass':>10}" + "".join(f"{name:>11}" for name in columns) + "  verdict"]
    for part, link in links.items():
        verdict, i = judge(link.inertia), link.inertia
        numbers = (i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2], *verdict.moments, verdict.triangle_margin)
        text = " and ".join(verdict.reasons()) or "positive definite, physical"
        rows.append(
            f"{part:7}{link.mass:10.6f}" + "".join(f"{float(number):11.6f}" for number in numbers) + f"  {text}"
        )
    return "\n".join(rows)


class InertialsCommand(Command):
    """Print mass, inertia tensor and principal moments of each link of the Panda.

    Also the triangle margin (sum of the two smaller moments minus the largest) and whether the tensor is positive
    definite; a body for which one of them is negative cannot exist.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("--set", choices=INERTIAL_SETS, default="barycentric", help="inertial set (default: %(default)s)"),
            Argument(
                "--steiner",
                choices=tuple(_STEINER),
                help="change the reference point of each tensor before printing: apply adds Steiner's term "
                "m (q'q E - q q') (centre of mass to link origin, thesis Eq. 1), undo subtracts it (Eq. 2)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Print the table."""
        point = {None: "unchanged", "apply": "Steiner's term added", "undo": "Steiner's term subtracted"}
        print(
            f"inertials '{arguments.set}', {point[arguments.steiner]}; mass [kg], inertia tensor, principal moments "
            "e1..e3 and triangle margin e1 + e2 - e3 [kg m^2]"
        )
        print(report(moved(inertials(arguments.set), arguments.steiner)))
