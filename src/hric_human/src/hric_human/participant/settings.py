"""Parameters of a simulated human in the robot's plant."""

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
from hric_human.body.regions import TISSUE_LAWS
from hric_human.body.segments import SIDES, link_name
from hric_human.body.subject import PARTS
from hric_human.control.human_control import checked, hand_side
from hric_human.participant.walk import WalkSettings

SUBJECTS = Path(__file__).resolve().parents[3] / "config" / "subjects"
"""Folder of the subjects that come with the package; the names of its files are the subjects' names."""
TORQUE, MUSCLE = "torque", "muscle"
"""Values of the parameter `drive`: joint torques act directly, or are produced by muscles."""
HUMAN = "human"
"""Name of the simulated person beside the robot, of their topics (`hric/human/...`), and of their parameters."""
HAND = "hand"
"""Value of a grip's parameter `holder` for the hand that tracks the reference and senses forces."""


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
    text="body of the person: name of a file in `config/subjects`, path of a file, or its keys",
    shape=_subject_shape,
)


@dataclass(frozen=True)
class CloseSettings(Settings):
    """Conditions for closing a grip: it closes after a time, as soon as palm and handle are near each other."""

    separator = "."
    time: float = number(0.0, minimum=0.0, unit="s", text="after the motion's start; 0: from the first cycle on")
    distance: float = number(0.05, above=0.0, maximum=0.5, unit="m", text="maximum distance between palm and handle")
    by_service: bool = flag(False, text="true: closes only when its service is called")


@dataclass(frozen=True)
class ReleaseSettings(Settings):
    """Conditions for opening a grip; without time and load it opens only when its service is called."""

    separator = "."
    time: float | None = number(None, minimum=0.0, unit="s", text="after the motion's start")
    load: float | None = number(
        None, above=0.0, unit="N", text="force of the grip at which it opens, the weight of the held object included"
    )
    delay: float = number(0.0, minimum=0.0, maximum=5.0, unit="s", text="from reaching the load to opening")

    def check(self, where: str) -> None:
        """Refuse a delay without a load, since it would have no effect."""
        if self.load is None:
            refuse_void(self, "delay", where, f"{where}load")


@dataclass(frozen=True)
class GripSettings(Settings):
    """Settings of a grip: a spring and damper between holder and held body, relaxed where the grip closes."""

    separator = "."
    held: str = text(empty=False, text='body that is held: "link" of the robot or "model::link"')
    holder: str = text(
        HAND, empty=False, text="body that holds it; hand: the hand that tracks references and senses forces"
    )
    handle: Vector = numbers(
        3, ORIGIN, minimum=-3.0, maximum=3.0, unit="m", text="point at which the body is held, in axes of its link"
    )
    palm: Vector = numbers(
        3, ORIGIN, unit="m", text="point of the holder, in axes of its link; for a hand from its centre of mass"
    )
    stiffness: float = number(
        1e4, above=0.0, maximum=1e6, unit="N/m", text="stiffness of the spring between palm and handle"
    )
    damping: float = number(100.0, minimum=0.0, unit="N s/m", text="damping between palm and handle")
    rotational_stiffness: float = number(
        50.0, minimum=0.0, unit="N m/rad", text="stiffness against rotation in the hand"
    )
    rotational_damping: float = number(0.25, minimum=0.0, unit="N m s/rad", text="damping of rotation in the hand")
    force_limit: float | None = number(None, above=0.0, unit="N", text="force at which the grip slips; none: never")
    torque_limit: float | None = number(
        None, above=0.0, unit="N m", text="torque at which the grip slips in rotation; none: never"
    )
    close: CloseSettings = section(CloseSettings)
    release: ReleaseSettings = section(ReleaseSettings)


@dataclass(frozen=True)
class MuscleSettings(Settings):
    """Settings of a person's muscles, and of the static optimisation that shares joint torques among them."""

    separator = "."
    anatomy: str = text(
        "delft",
        empty=False,
        text="muscles of an arm: `delft`, which comes with the package, or path or package:// address of a fitted file "
        "or of an arm model",
    )
    rate: float = number(
        100.0,
        minimum=10.0,
        maximum=1000.0,
        unit="Hz",
        text="of decisions about activations; a divisor of the control loop's rate",
    )
    co_contraction: float = number(0.0, minimum=0.0, maximum=0.5, text="increase of all muscles' minimum activation")
    strength: float = number(1.0, above=0.0, maximum=5.0, text="factor on the strength of all muscles of the subject")


@dataclass(frozen=True)
class HumanSettings(Settings):
    """Settings of a simulated human: body, position, motion and grips."""

    separator = "."
    subject: Subject = SUBJECT
    parts: str | None = choice(*PARTS, default=None, text="simulated parts of the body; none: as in the subject's file")
    posture: str | None = choice("standing", "seated", default=None, text="none: as in the subject's file")
    position: tuple[float, float] = numbers(
        2,
        (0.95, 0.0),
        unit="m",
        text="x, y in the world of the midpoint between the hips, or between the shoulders if there are only arms",
    )
    heading: float = number(math.pi, minimum=-7.0, maximum=7.0, unit="rad", text="viewing direction, from x towards y")
    floor: float = number(-0.75, unit="m", text="height of the floor below the person, in the world")
    control: Any = anything({}, default_text="`{}`", text='controller of the joints: see hric_human, "Control"')
    drive: str = choice(
        TORQUE, MUSCLE, text="torque: the torque computed by `control` acts on the joints; muscle: muscles produce it"
    )
    muscles: MuscleSettings = section(MuscleSettings)
    watches: str = text("", text="link of the robot that the person sees, for motions that react to it; empty: none")
    walk: WalkSettings | None = section(
        WalkSettings, None, text="path of the person; none: the root is fixed to the world"
    )
    grips: Mapping[str, GripSettings] = mapping(section(GripSettings), {}, text="grips on objects, by name")
    contact_area: float | None = number(
        None,
        above=0.0,
        unit="m^2",
        default_text="not known",
        text="contact area from which the verdict computes pressures: the smaller of the robot's and the body's",
    )
    contact_law: str = choice(
        *TISSUE_LAWS,
        text="contact law of the person's surface: `spring`, of ISO/TS 15066; `hunt_crossley`; `viscoelastic`, a layer "
        "that relaxes",
    )
    rate: float = number(200.0, above=0.0, maximum=1000.0, unit="Hz", text="of the person's topics")
    seed: int = whole(0, minimum=0, text="of all random variation")

    def check(self, where: str) -> None:
        """Refuse parameters that the controller would refuse, and muscle settings without a muscle drive.

        Raises:
            ParameterError: a parameter is invalid, or has no effect with this drive.
        """
        if self.drive != MUSCLE:
            for name in ("rate", "co_contraction"):
                refuse_void(self.muscles, name, f"{where}muscles.", f"{where}drive: {MUSCLE}")
        checked(self.control, tuple(joint.name for joint in joints(self.person.chains)), f"{where}control")

    @property
    def person(self) -> Subject:
        """Subject, with `parts` and `posture` of these settings."""
        changes = {name: value for name in ("parts", "posture") if (value := getattr(self, name)) is not None}
        return replace(self.subject, **changes)

    def body(self) -> Body:
        """Return the body of the person."""
        return describe(self.person)

    @classmethod
    def beside_robot(cls, root: Any) -> "HumanSettings | None":
        """Return the settings of the simulated person beside a robot; None: there is none.

        Args:
            root: ROS node in the robot's namespace.
        """
        where = f"robot/participants/{HUMAN}"
        if not root.has_param(where):
            return None
        return cls.of({key: value for key, value in root.param(where).items() if key != "type"}, HUMAN)

    def gripping(self, body: Body) -> tuple[str, ...]:
        """Return the sides whose hand holds something in one of the grips."""
        links = {grip.holder.rpartition("::")[2] for grip in self.grips.values()}
        own = hand_side(body, (self.control or {}).get("side", "dominant"), "") if HAND in links else ""
        return tuple(side for side in SIDES if side == own or link_name("hand", side) in links)

    def root(self, body: Body) -> Pose:
        """Return the pose of the body's root link in the world."""
        x, y = self.position
        return Pose((x, y, self.floor + body.base_height), from_rotation_vector((0.0, 0.0, self.heading)))
