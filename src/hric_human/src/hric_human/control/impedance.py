"""Built-in controller of a human: joint impedance about a reference motion, with gravity compensation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from hric_core.geometry import Vector
from hric_core.native import load
from hric_core.parameters import Settings, number, per_joint, refused, variant
from hric_human.control.controller import HumanController, Person, Senses
from hric_human.control.kinematics import own_weight
from hric_human.control.recorded import RECORDED
from hric_human.control.references import REFERENCES, Reference, ReferenceSettings

_Impedance = load("hric_human_impedance").Impedance
DAMPING = 0.05
"""Ratio of damping to stiffness [s] (PMC2784227, which gives it for each muscle)."""


class StiffnessRow(NamedTuple):
    """Stiffness of a joint.

    Attributes:
        relaxed: stiffness without load [N m/rad].
        growth: increase of the stiffness per gravity torque of the joint [1/rad].
        source: source of both numbers.
    """

    relaxed: float
    growth: float
    source: str


GOMI = "Gomi & Osu 1998, J. Neurosci. 18:8965, in a horizontal plane; numbers unconfirmed"
OWN = "project default, unconfirmed"
SHOULDER, ELBOW = StiffnessRow(10.8, 3.18, GOMI), StiffnessRow(8.67, 6.18, GOMI)
TRUNK, NECK = StiffnessRow(200.0, 0.0, OWN), StiffnessRow(20.0, 0.0, OWN)
WRIST, LEG, ANKLE = StiffnessRow(2.0, 0.0, OWN), StiffnessRow(100.0, 0.0, OWN), StiffnessRow(30.0, 0.0, OWN)
STIFFNESS = {
    **dict.fromkeys(("trunk_flex", "trunk_bend", "trunk_rot"), TRUNK),
    **dict.fromkeys(("neck_flex", "neck_bend", "neck_rot"), NECK),
    **dict.fromkeys(("sh_flex", "sh_abd", "sh_rot"), SHOULDER),
    "el_flex": ELBOW,
    **dict.fromkeys(("pro_sup", "wr_flex", "wr_dev"), WRIST),
    **dict.fromkeys(("hip_flex", "hip_abd", "hip_rot", "knee_flex"), LEG),
    **dict.fromkeys(("ankle_flex", "ankle_inv"), ANKLE),
}
"""Stiffness by joint, without its side.

The growth of single-joint stiffness with the joint's torque is in the abstract of Gomi & Osu; equal stiffness about all
axes of the shoulder is a project default.
"""
CROSS = StiffnessRow(2.67, 2.25, f"{GOMI}; means of both off-diagonal terms; growth with the torque of the elbow")
"""Stiffness between shoulder and elbow, from muscles that span both.

The abstract of Gomi & Osu has its correlation with the elbow's torque. It was measured with parallel axes; at the
shoulder it acts about the axis of the elbow.
"""
CROSS_LIMIT = 0.9
"""Limit of the stiffness between two joints, relative to the geometric mean of their own stiffness [1]; with 1 or more
the arm would be unstable. Project default."""


class ElbowCoupling(NamedTuple):
    """Indices of the joints of one arm that muscles of both shoulder and elbow couple."""

    flexion: int
    abduction: int
    rotation: int
    elbow: int


def couplings(joints: Sequence[str]) -> list[ElbowCoupling]:
    """Return the couplings of all arms of a body with these joints."""
    sides = [name.removesuffix("_el_flex") for name in joints if name.endswith("_el_flex")]
    names = ("sh_flex", "sh_abd", "sh_rot", "el_flex")
    return [ElbowCoupling(*(joints.index(f"{side}_{name}") for name in names)) for side in sides]


@dataclass(frozen=True)
class ImpedanceArmSettings(Settings):
    """Parameters of ImpedanceArm."""

    reference: ReferenceSettings = variant(
        "program", REFERENCES | RECORDED, "rest", {}, text="desired motion of the joints"
    )
    stiffness: tuple[float, ...] | None = per_joint(
        number(unit="N m/rad", minimum=0.0, maximum=1e4), None, text="without load; none: published values"
    )
    growth: tuple[float, ...] | None = per_joint(
        number(unit="1/rad", minimum=0.0, maximum=100.0),
        None,
        text="increase of the stiffness per gravity torque; none: published values if `stiffness` is none too, else 0",
    )
    damping: tuple[float, ...] | None = per_joint(
        number(unit="N m s/rad", minimum=0.0, maximum=1e3), None, text="none: 0.05 s times the stiffness"
    )
    reflex: float = number(
        0.25,
        minimum=0.0,
        maximum=1.0,
        text="share of stiffness and damping that acts on the delayed senses, as reflexes; the rest is the muscles' "
        "mechanical response, without delay (project default, unconfirmed)",
    )
    load: float = number(
        0.0,
        minimum=0.0,
        maximum=50.0,
        unit="kg",
        text="mass in the hand that the person expects and compensates like their own weight; refused if a joint is "
        "too weak to hold it at the start",
    )


class ImpedanceArm(HumanController):
    """Joint impedance: tau = K (q_ref - q) + D (dq_ref - dq) + g(q), K = K_0 + k |g(q)|, D = 0.05 s K.

    With the published stiffness K has terms between shoulder and elbow, see CROSS; otherwise it is diagonal.
    g: gravity torque of the body and the expected load, at the delayed joint positions. K and D act on a weighted mean
    of q and dq: the share `reflex` is delayed (reflexes), the rest is not (mechanical response of the muscles).
    """

    settings = ImpedanceArmSettings

    def init(self, person: Person, settings: Any) -> None:
        """Set stiffness and damping, and compute the reference."""
        rows = [STIFFNESS[joint.row.name] for joint in person.body.joints.values()]
        published = settings.stiffness is None
        stiffness = [row.relaxed for row in rows] if published else settings.stiffness
        growth = settings.growth or [row.growth if published else 0.0 for row in rows]
        damping = settings.damping or [0.0] * len(rows)
        lead = DAMPING if settings.damping is None else 0.0  # damping per stiffness [s]
        cross = couplings(person.joints) if published else [], (CROSS.relaxed, CROSS.growth, CROSS_LIMIT)
        self._law = _Impedance(stiffness, growth, damping, settings.reflex, lead, *cross)
        self._weight = person.own_weight
        if settings.load > 0.0:
            hand = person.body.segments[f"{person.side}_hand"].link
            self._weight = own_weight(person.body, person.gravity, {hand: settings.load})
        self._reference: Reference = settings.reference.reference(person)
        self.end = self._reference.end
        if settings.load > 0.0:
            self._check_load(person, settings)

    def _check_load(self, person: Person, settings: ImpedanceArmSettings) -> None:
        """Refuse a load that a joint is too weak to hold in the initial posture; torques are linear in the load."""
        posture = self.posture()
        alone, loaded, held = person.own_weight(posture), self._weight(posture), {}
        for joint, weight, total, low, high in zip(
            person.joints, alone, loaded, person.weakest, person.strongest, strict=True
        ):
            per_kilogram = (total - weight) / settings.load
            if per_kilogram:
                held[joint] = max(0.0, ((high if per_kilogram > 0.0 else low) - weight) / per_kilogram)
        weakest = min(held, key=held.__getitem__, default=None)
        if weakest is not None and settings.load > held[weakest]:
            valid = f"up to {math.floor(10.0 * held[weakest]) / 10.0:g} [kg], which {weakest} can hold at the start"
            raise refused(f"{settings.prefix}load", settings.load, valid)

    def posture(self) -> Sequence[float]:
        """Return the initial joint positions of the reference, n floats [rad]."""
        return self._reference.at(-math.inf)[0]

    def start(self, time: float) -> None:
        """Start the reference motion at `time` [s]."""
        self._reference.start(time)

    def see(self, time: float, position: Vector) -> None:
        """Pass the position [m] of the robot's end effector to the reference."""
        self._reference.see(time, position)

    def update(self, time: float, senses: Senses) -> Sequence[float]:
        """Return the joint torque of the impedance law, n floats [N m]."""
        if self._reference.feels:
            self._reference.feel(time, senses.force)
        q_ref, dq_ref = self._reference.at(time)
        q, dq = senses.muscles
        tau: list[float] = self._law.torque(q_ref, dq_ref, q, dq, senses.q, senses.dq, self._weight(senses.q))
        return tau
