"""Subject whose body is generated: checked settings from a mapping or a YAML file."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hric_core.node import REQUIRED
from hric_core.parameters import Mistakes, Settings, choice, mapping, number, read_yaml, refused, text, unknown
from hric_human.body.anthropometry import scaled_lengths, scaled_masses

PARTS = {
    "right_arm": ("right_arm",),
    "left_arm": ("left_arm",),
    "both_arms": ("right_arm", "left_arm"),
    "upper_body": ("trunk", "right_arm", "left_arm"),
    "whole_body": ("trunk", "right_arm", "left_arm", "right_leg", "left_leg"),
}
"""Chains of joints for each value of the setting `parts`, in order; the trunk includes the head."""
FAR = {"length": 2.0, "mass": 3.0}
"""Largest accepted ratio between a measured value and the table's, either way; a larger one suggests a wrong unit.

Project default, unconfirmed.
"""
LIGHTEST = 30.0
"""Smallest accepted mass of a subject [kg] (project default, unconfirmed)."""
_CODE = re.compile(r"(?=\D*\d)[A-Za-z0-9]{1,12}")


def _pseudonym(code: str) -> str:
    if not _CODE.fullmatch(code):
        raise ValueError
    return code


@dataclass(frozen=True)
class Subject(Settings):
    """Settings of one person, or of one percentile of a population: size, mass, sex, and body parts to generate."""

    code: str = text(
        valid="a pseudonym of up to 12 letters and digits, with a digit, such as S07",
        made=_pseudonym,
        text="pseudonym, never a name",
    )
    mass: float = number(unit="kg", minimum=LIGHTEST, maximum=200.0, text="of the whole body")
    height: float = number(unit="m", minimum=1.2, maximum=2.2, text="standing")
    sex: str = choice("female", "male", default=REQUIRED, text="whose table of de Leva 1996 is taken")
    dominant_hand: str = choice("right", "left", text="the side that ISO/TS 15066 limits differently")
    parts: str = choice(*PARTS, text="what is described")
    posture: str = choice("standing", "seated", text="of the rest pose")
    lengths: Mapping[str, float] = mapping(
        number(unit="m", above=0.0), default={}, text="measured lengths in place of the table's, by name"
    )
    masses: Mapping[str, float] = mapping(
        number(unit="kg", above=0.0), default={}, text="measured masses in place of the table's, of one side, by name"
    )
    waist_forward: float = number(
        0.0, unit="m", minimum=-0.2, maximum=0.2, text="how far the joint of the waist is ahead of the hips"
    )

    @property
    def chains(self) -> tuple[str, ...]:
        """Chains of joints of the described parts (values of PARTS)."""
        return PARTS[self.parts]

    def check(self, where: str) -> None:
        """Refuse measurements of unknown lengths or masses, and those that are far from the table's."""
        lengths, masses = scaled_lengths(self.sex, self.height), scaled_masses(self.sex, self.mass)
        mistakes = Mistakes()
        for kind, measured, published, unit in (
            ("length", self.lengths, lengths, "m"),
            ("mass", self.masses, masses, "kg"),
        ):
            for name, value in measured.items():
                with mistakes.noted():
                    if name not in published:
                        raise unknown(kind, name, published, where.rstrip(":. "))
                    low, high = published[name] / FAR[kind], published[name] * FAR[kind]
                    if not low <= value <= high:
                        plural = "masses" if kind == "mass" else "lengths"
                        raise refused(f"{where}{plural}.{name}", value, f"{low:.3g} to {high:.3g} [{unit}]")
        mistakes.raise_all()


def load(path: Path) -> Subject:
    """Return the subject of a YAML file. Raises ParameterError with all mistakes of the file."""
    return Subject.of(read_yaml(path), f"{path.name}:")
