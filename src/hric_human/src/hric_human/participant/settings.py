"""Parameters of a human in the robot's plant."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hric_core.geometry import ORIGIN, Pose, Vector, from_rotation_vector
from hric_core.parameters import (
    Parameter,
    Settings,
    anything,
    choice,
    flag,
    mapping,
    number,
    numbers,
    refuse_void,
    schema_of,
    section,
    text,
    unknown,
    whole,
)
from hric_human.body import Body, Subject, describe, load
from hric_human.body.joints import joints
from hric_human.body.subject import PARTS
from hric_human.control.human_control import checked
from hric_human.participant.walk import WalkSettings

SUBJECTS = Path(__file__).resolve().parents[3] / "config" / "subjects"
"""Folder of the bodies that come with the package; the files' names are the subjects' names."""
TORQUE, MUSCLE = "torque", "muscle"
"""Names of the drives."""
HAND = "hand"
"""Name of the holder that is the hand of the body, which tracks the reference and senses forces."""


def _subject(value: Any, where: str, _: Sequence[str]) -> Subject:
    if isinstance(value, Subject):
        return value
    if isinstance(value, Mapping):
        return Subject.of(value, where)
    if not isinstance(value, str) or not value:
        raise ValueError
    if value.endswith((".yaml", ".yml")) and Path(value).is_file():
        return load(Path(value))
    names = sorted(path.stem for path in SUBJECTS.glob("*.yaml"))
    if value not in names:
        raise unknown("subject", value, (*names, "the path of a YAML file"), where)
    return load(SUBJECTS / f"{value}.yaml")


def _subject_shape() -> dict[str, object]:
    return {"anyOf": [{"type": "string"}, schema_of(section(Subject))]}


SUBJECT: Any = Parameter(
    "subject",
    "a name or path of a subject's file, or a mapping with its keys",
    _subject,
    "P50_male",
    text="whose body: name of a file in `config/subjects`, path of one, or its keys",
    shape=_subject_shape,
)


@dataclass(frozen=True)
class CloseSettings(Settings):
    """Conditions on which a grip closes: from a time on, as soon as palm and handle are near."""

    separator = "."
    time: float = number(0.0, minimum=0.0, unit="s", text="after the motion's start; 0: from the first cycle on")
    distance: float = number(0.05, above=0.0, maximum=0.5, unit="m", text="between palm and handle at the most")
    by_service: bool = flag(False, text="closes only when the service asks for it")


@dataclass(frozen=True)
class ReleaseSettings(Settings):
    """Conditions on which a grip opens; without time and load it never opens by itself."""

    separator = "."
    time: float | None = number(None, minimum=0.0, unit="s", text="after the motion's start")
    load: float | None = number(
        None, above=0.0, unit="N", text="when it carries so much, the weight of what is held included"
    )
    delay: float = number(0.0, minimum=0.0, maximum=5.0, unit="s", text="from the load to the open hand")

    def check(self, where: str) -> None:
        """Refuse a delay after no load."""
        if self.load is None:
            refuse_void(self, "delay", where, f"{where}load")


@dataclass(frozen=True)
class GripSettings(Settings):
    """Spring and damper between holder and held body, relaxed at the pose in which the grip closes."""

    separator = "."
    held: str = text(empty=False, text='body that is held: "link" of the robot or "model::link"')
    holder: str = text(HAND, empty=False, text="body that holds it; hand: the one that follows and feels")
    handle: Vector = numbers(
        3, ORIGIN, minimum=-3.0, maximum=3.0, unit="m", text="where it is held, in axes of its link"
    )
    palm: Vector = numbers(
        3, ORIGIN, unit="m", text="where it is held, in axes of the holder's link; of a hand from its centre of mass"
    )
    stiffness: float = number(1e4, above=0.0, maximum=1e6, unit="N/m", text="of the distance")
    damping: float = number(100.0, minimum=0.0, unit="N s/m", text="of the distance")
    rotational_stiffness: float = number(50.0, minimum=0.0, unit="N m/rad", text="of the rotation")
    rotational_damping: float = number(0.25, minimum=0.0, unit="N m s/rad", text="of the rotation")
    force_limit: float | None = number(None, above=0.0, unit="N", text="at which it slips; none: it does not")
    torque_limit: float | None = number(
        None, above=0.0, unit="N m", text="at which it slips in rotation; none: it does not"
    )
    close: CloseSettings = section(CloseSettings)
    release: ReleaseSettings = section(ReleaseSettings)


@dataclass(frozen=True)
class MuscleSettings(Settings):
    """Muscles of a body and the law that shares the joint torques among them."""

    separator = "."
    anatomy: str = text(
        "delft",
        empty=False,
        text="`delft`, which comes with the package, or address of a fitted file or of a model of an arm",
    )
    rate: float = number(
        100.0,
        minimum=10.0,
        maximum=1000.0,
        unit="Hz",
        text="of decisions about activations; a whole part of the cycles",
    )
    co_contraction: float = number(0.0, minimum=0.0, maximum=0.5, text="activation of all muscles beyond the least")
    strength: float = number(1.0, above=0.0, maximum=5.0, text="of all muscles, times that of the subject")


@dataclass(frozen=True)
class HumanSettings(Settings):
    """Human in the plant: position, motion and grips."""

    separator = "."
    subject: Subject = SUBJECT
    parts: str | None = choice(*PARTS, default=None, text="simulated parts of the body; none: as in the subject's file")
    posture: str | None = choice("standing", "seated", default=None, text="none: as in the subject's file")
    position: tuple[float, float] = numbers(
        2,
        (0.95, 0.0),
        unit="m",
        text="x, y in the world of the middle between the hips, or between the shoulders of a body of arms alone",
    )
    heading: float = number(math.pi, minimum=-7.0, maximum=7.0, unit="rad", text="viewing direction, from x towards y")
    floor: float = number(-0.75, unit="m", text="height of the floor below the person, in the world")
    control: Any = anything({}, default_text="`{}`", text="what moves the person's joints: Control, below")
    drive: str = choice(
        TORQUE, MUSCLE, text="what gives the torque that `control` computes: the joints themselves, or muscles"
    )
    muscles: MuscleSettings = section(MuscleSettings)
    watches: str = text("", text="link of the robot that the person sees, for motions that react to it; empty: none")
    walk: WalkSettings | None = section(
        WalkSettings, None, text="path of the person; none: the root is fixed to the world"
    )
    grips: Mapping[str, GripSettings] = mapping(section(GripSettings), {}, text="what is held, by name")
    contact_area: float | None = number(
        None,
        above=0.0,
        unit="m^2",
        default_text="not known",
        text="over which contacts act in the verdict, the smaller of the robot's and the body's",
    )
    rate: float = number(200.0, above=0.0, maximum=1000.0, unit="Hz", text="of the person's topics")
    seed: int = whole(0, minimum=0, text="of all that varies")

    def check(self, where: str) -> None:
        """Refuse parameters that the controller would refuse, and muscle settings that move nobody.

        Raises:
            ParameterError: a parameter is invalid, or has no effect with this drive.
        """
        if self.drive != MUSCLE:
            for name in ("rate", "co_contraction"):
                refuse_void(self.muscles, name, f"{where}muscles.", f"{where}drive: {MUSCLE}")
        checked(self.control, tuple(joint.name for joint in joints(self.person.chains)), f"{where}control")

    @property
    def person(self) -> Subject:
        """The subject, with `parts` and `posture` of these settings."""
        changes = {name: value for name in ("parts", "posture") if (value := getattr(self, name)) is not None}
        return replace(self.subject, **changes)

    def body(self) -> Body:
        """Return the body of the person."""
        return describe(self.person)

    def root(self, body: Body) -> Pose:
        """Return T_world_root of the body."""
        x, y = self.position
        return Pose((x, y, self.floor + body.base_height), from_rotation_vector((0.0, 0.0, self.heading)))
