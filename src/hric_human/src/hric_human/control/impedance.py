"""Built-in controller: joint impedance about a reference, and the body's own weight."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from hric_core.geometry import Vector
from hric_core.parameters import Settings, number, per_joint, refused, variant
from hric_human.control.controller import HumanController, Person, Senses
from hric_human.control.kinematics import own_weight
from hric_human.control.recorded import RECORDED
from hric_human.control.references import REFERENCES, Reference, ReferenceSettings

DAMPING = 0.05
"""Ratio of damping to stiffness [s] (PMC2784227, where it is that of each muscle)."""


class StiffnessRow(NamedTuple):
    """Stiffness of a joint.

    Attributes:
        relaxed: stiffness without load [N m/rad].
        growth: increase with the torque of the load [1/rad].
        source: source of both.
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

The growth of single-joint stiffness with the joint's torque is in the abstract of Gomi & Osu; the same stiffness of all
axes of the shoulder is a project default.
"""


@dataclass(frozen=True)
class ImpedanceArmSettings(Settings):
    """Parameters of ImpedanceArm."""

    reference: ReferenceSettings = variant(
        "program", REFERENCES | RECORDED, "rest", {}, text="where the joints are to be"
    )
    stiffness: tuple[float, ...] | None = per_joint(
        number(unit="N m/rad", minimum=0.0, maximum=1e4), None, text="without load; none: as published"
    )
    growth: tuple[float, ...] | None = per_joint(
        number(unit="1/rad", minimum=0.0, maximum=100.0),
        None,
        text="of the stiffness with the torque of the own weight; none: as published, where `stiffness` is none, too, "
        "else 0",
    )
    damping: tuple[float, ...] | None = per_joint(
        number(unit="N m s/rad", minimum=0.0, maximum=1e3), None, text="none: 0.05 s of the stiffness"
    )
    reflex: float = number(
        0.25,
        minimum=0.0,
        maximum=1.0,
        text="share of stiffness and damping that acts on the late senses; the rest is the muscles' own and acts at "
        "once (project default, unconfirmed)",
    )
    load: float = number(
        0.0,
        minimum=0.0,
        maximum=50.0,
        unit="kg",
        text="mass in the hand that the person expects, and holds as their own weight; refused where a joint is too "
        "weak for it at the start",
    )


class ImpedanceArm(HumanController):
    """Joint impedance: tau = K (q_ref - q) + D (dq_ref - dq) + g(q), K = K_0 + k |g(q)|, D = 0.05 s K.

    g: torque that holds the body and the expected load, from delayed senses. q and dq are the undelayed values of the
    muscles' response, and for a share `reflex` the delayed ones. Without a delay both are the same.
    """

    settings = ImpedanceArmSettings

    def init(self, person: Person, settings: Any) -> None:
        """Read stiffness and damping, and compute the reference."""
        rows = [STIFFNESS[joint.row.name] for joint in person.body.joints.values()]
        published = settings.stiffness is None
        stiffness = [row.relaxed for row in rows] if published else settings.stiffness
        growth = settings.growth or [row.growth if published else 0.0 for row in rows]
        self._lead = DAMPING if settings.damping is None else 0.0
        self._impedance = list(zip(stiffness, growth, settings.damping or [0.0] * len(rows), strict=True))
        self._reflex, self._weight = settings.reflex, person.own_weight
        if settings.load > 0.0:
            hand = person.body.segments[f"{person.side}_hand"].link
            self._weight = own_weight(person.body, person.gravity, {hand: settings.load})
        self._reference: Reference = settings.reference.reference(person)
        self.end = self._reference.end
        if settings.load > 0.0:
            self._check_load(person, settings)

    def _check_load(self, person: Person, settings: ImpedanceArmSettings) -> None:
        """Refuse a load that a joint is too weak for at the start of the motion. Torques are linear in the load."""
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
            valid = f"up to {math.floor(10.0 * held[weakest]) / 10.0:g} [kg], which {weakest} holds at the start"
            raise refused(f"{settings.prefix}load", settings.load, valid)

    def posture(self) -> Sequence[float]:
        """Return the first joint positions of the reference."""
        return self._reference.at(-math.inf)[0]

    def start(self, time: float) -> None:
        """Start the reference."""
        self._reference.start(time)

    def see(self, time: float, position: Vector) -> None:
        """Pass the observation to the reference."""
        self._reference.see(time, position)

    def update(self, time: float, senses: Senses) -> Sequence[float]:
        """Return the impedance torque; lead: damping per stiffness [s], d: damping set separately."""
        self._reference.feel(time, senses.force)
        q_ref, dq_ref = self._reference.at(time)
        q, dq = senses.muscles
        reflex, lead = self._reflex, self._lead
        q = [now + reflex * (late - now) for now, late in zip(q, senses.q, strict=True)]
        dq = [now + reflex * (late - now) for now, late in zip(dq, senses.dq, strict=True)]
        return [
            (k + s * abs(g)) * (a - b + lead * (v - w)) + d * (v - w) + g
            for (k, s, d), g, a, b, v, w in zip(
                self._impedance, self._weight(senses.q), q_ref, q, dq_ref, dq, strict=True
            )
        ]
