"""Work file: what the recording of a task cannot show, such as its duration in a shift and the breaks.

    work = load(Path("work.yaml"))
    work.lifts, work.pushes, work.repetitive

A value that is not stated is not known: its method assumes the whole range of its table.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hric_assessment.tables import niosh_table, ocra_table
from hric_core.node import REQUIRED
from hric_core.parameters import Settings, choice, listing, mapping, number, read_yaml, refused, section, text, unknown

MEN, WOMEN, MIXED = WORKFORCES = ("men", "women", "mixed")
UNKNOWN: Any = {"default_text": "not known"}


@dataclass(frozen=True)
class TimedTask(Settings):
    """Task between two times of the recording."""

    begin: float = number(unit="s", text="time in the recording at which the lift, push or pull begins")
    end: float = number(unit="s", text="time at which it ends")

    def check(self, where: str) -> None:
        """Refuse an end before the begin."""
        if not self.begin < self.end:
            raise refused(f"{where}end", self.end, f"a number above begin ({self.begin:g})")


@dataclass(frozen=True)
class LiftTask(TimedTask):
    """Lift of an object with both hands, rated at its begin and its end by the NIOSH equation."""

    load: float = number(unit="kg", above=0.0, text="mass of the object")
    per_minute: float | None = number(None, minimum=0.0, unit="1/min", text="lifts per minute of the work", **UNKNOWN)
    hours: float | None = number(None, above=0.0, unit="h", text="duration of the work", **UNKNOWN)
    coupling: str | None = text(None, empty=False, text="grip: good, fair or poor", **UNKNOWN)

    def check(self, where: str) -> None:
        """Refuse an end before the begin, and an unknown coupling."""
        super().check(where)
        if self.coupling not in (None, *(valid := niosh_table().couplings)):
            raise unknown("coupling", self.coupling, valid, where.rstrip("."))


@dataclass(frozen=True)
class PushTask(TimedTask):
    """Pushing or pulling with both hands, rated by the forces of Snook and Ciriello (ISO 11228-2, method 1)."""

    action: str = choice("push", "pull", default=REQUIRED, text="direction of the force on the object")
    initial: float | None = number(
        None, minimum=0.0, unit="N", default_text="from the grips", text="force that sets the object in motion"
    )
    sustained: float | None = number(
        None, minimum=0.0, unit="N", default_text="from the grips", text="force that keeps it in motion"
    )
    distance: float | None = number(None, above=0.0, unit="m", text="distance of pushing or pulling", **UNKNOWN)
    interval: float | None = number(None, above=0.0, unit="s", text="time from one action to the next", **UNKNOWN)
    workforce: str | None = choice(*WORKFORCES, default=None, text="people who do the work", **UNKNOWN)


@dataclass(frozen=True)
class RepetitiveTask(Settings):
    """Repetitive work of which the recording is a typical part, rated by the OCRA checklist (ISO 11228-3)."""

    minutes: float | None = number(
        None,
        above=0.0,
        maximum=1440.0,
        unit="min",
        text="repetitive work in a shift, without breaks and other work",
        **UNKNOWN,
    )
    actions: float | None = number(
        None, minimum=0.0, unit="1/min", default_text="at least those of the motion", text="technical actions of an arm"
    )
    factors: Mapping[str, str] = mapping(
        text(empty=False),
        default={},
        text="option of each factor of the checklist, see below; a missing one is not known",
    )

    def check(self, where: str) -> None:
        """Refuse factors and options that the checklist does not have."""
        table = ocra_table()
        for name, option in self.factors.items():
            if name not in table.factors:
                raise unknown("factor", name, table.factors, f"{where}factors")
            if option not in table.factors[name]:
                raise unknown(name, option, table.factors[name], f"{where}factors")

    @property
    def options(self) -> Mapping[str, str | None]:
        """Stated option of each factor of the checklist; None: not known."""
        return {name: self.factors.get(name) for name in ocra_table().factors}


@dataclass(frozen=True)
class Work(Settings):
    """Work of the person in a recording."""

    lifts: tuple[LiftTask, ...] = listing(section(LiftTask), default=(), text="lifts, see below")
    pushes: tuple[PushTask, ...] = listing(section(PushTask), default=(), text="pushing and pulling, see below")
    repetitive: tuple[RepetitiveTask, ...] = listing(
        section(RepetitiveTask), default=(), text="repetitive work, see below"
    )


def load(path: Path) -> Work:
    """Read a work file. Raises ParameterError; all mistakes are listed."""
    return Work.of(read_yaml(path), f"{path.name}:")
