"""Metrics of the simulated human of a run, without the analysis that computes them (`human`), which imports much more.

All values are estimates of a model, never measurements of a person.
"""

from dataclasses import dataclass

from hric_analysis.muscle_metrics import MusclesMetrics
from hric_bags.records import RecordedHumanEvent
from hric_core.geometry import Vector

SETTLED, SETTLING_TIME = 0.05, 3.0
"""Requirement of this project on stable guidance: grip force and hand speed fall below this share of their peaks [1]
within this time after the end of the motion [s]."""
SETTLES, UNSTABLE = "settles", "unstable"


@dataclass(frozen=True)
class ShareSpread:
    """Mean, smallest and largest share of the weight that a grip carries [1]."""

    mean: float
    min: float
    max: float


@dataclass(frozen=True)
class TransportMetrics:
    """Metrics of a body carried by two grips, during the motion of the person.

    Attributes:
        object: full name of the body.
        weight: weight [N]; None: not known.
        time: time for which both grips held the body [s].
        load_share: share of the weight on each grip, by its name; None: weight not known.
        squeeze_max, stretch_max: largest compression and tension [N]; squeeze_mean: mean of the internal force [N].
        tilt_max: largest inclination of the line between the grips [rad].
        path, lift: path length of the midpoint between the grips, and range of its height [m].
        smoothness: log dimensionless jerk of the midpoint [1]; None: it did not move.
        excess_rms, excess_max: RMS and maximum of the sum of both forces minus m (a - g) [N]; None: not known.
    """

    object: str
    weight: float | None
    time: float
    load_share: dict[str, ShareSpread] | None
    squeeze_max: float
    stretch_max: float
    squeeze_mean: float
    tilt_max: float
    path: float
    lift: float
    smoothness: float | None
    excess_rms: float | None
    excess_max: float | None


@dataclass(frozen=True)
class GripMetrics:
    """Force and work of one grip.

    Attributes:
        held, holder: names of the held and of the holding body.
        closed: time for which the grip was closed [s].
        force_max, force_max_time: largest force [N] and its time [s].
        slips: number of times that the body slipped; slipped: largest slip distance [m].
        force_mean, torque_max, work, work_absolute: see `hric_assessment.ergonomics.effort.Effort`.
    """

    held: str
    holder: str
    closed: float
    force_max: float | None
    force_max_time: float | None = None
    force_mean: float | None = None
    torque_max: float | None = None
    work: float | None = None
    work_absolute: float | None = None
    slips: int | None = None
    slipped: float | None = None


@dataclass(frozen=True)
class Handover:
    """Handover of a body from one grip to another.

    Attributes:
        object, giver, taker: names of the body, of the giving and of the taking grip.
        overlap: time for which both held the body [s].
        force_max: largest force of the taker in this time [N]; None: both never held the body together.
        dropped: True if no grip held the body for some time.
    """

    object: str
    giver: str
    taker: str
    overlap: float
    force_max: float | None
    dropped: bool


@dataclass(frozen=True)
class JointLoad:
    """Load of one joint of the person.

    Attributes:
        torque_max: largest torque [N m].
        share_max, share_mean: largest and mean ratio of torque to strength [1].
        clipped: number of times that the joint reached its strength limit.
    """

    torque_max: float
    share_max: float
    share_mean: float
    clipped: int


@dataclass(frozen=True)
class HandMetrics:
    """Motion of the person's hand.

    Attributes:
        speed_max: largest speed [m/s].
        path: length of the path [m].
        smoothness: log dimensionless jerk [1]; None: the hand did not move.
    """

    speed_max: float
    path: float
    smoothness: float | None


@dataclass(frozen=True)
class Settling:
    """Decay of grip forces and hand speed after the motion.

    Attributes:
        after: time after the motion from which the hand speed or a grip force stays low, by name [s]; None: never.
        verdict: SETTLES or UNSTABLE.
    """

    after: dict[str, float | None]
    verdict: str

    @property
    def decay(self) -> str:
        """Text with the time after which each signal stays low."""
        parts = [f"{name} {'never' if t is None else f'{t:.2f} s'}" for name, t in self.after.items()]
        return f"below {100 * SETTLED:.0f} % of the peak after: {', '.join(parts)}"


@dataclass(frozen=True)
class ExpectedImpact:
    """Expected values of an impact (closed form) and the recorded peak; see `hric_assessment.contact.impact`.

    Attributes:
        measured_peak: recorded peak force until the half sine ends [N]; ratio: measured over expected peak [1].
    """

    speed: float
    robot_mass: float
    human_mass: float
    stiffness: float
    mass: float
    peak: float
    duration: float
    impulse: float
    measured_peak: float
    ratio: float


@dataclass(frozen=True)
class ClampingMetrics:
    """Clamping force at the instant at which it is assessed.

    Attributes:
        time: robot time [s].
        force, balanced: contact force, and the force that the commanded torque balances [N].
        ratio: force relative to the balanced force [1].
    """

    time: float
    force: float
    balanced: float
    ratio: float


@dataclass(frozen=True)
class ContactMetrics:
    """Contact of a body region of the person, with its expected values.

    Attributes:
        point, normal, speed: begin_point, begin_normal and begin_speed of `hric_human.contact.RegionContact`, to which
            the attributes up to `interrupted` belong.
        transient: expected values of the impact; None: not known.
        press: clamping force; None: there was no clamping.
    """

    regions: tuple[str, ...]
    link: str
    other: str
    kind: str
    begin: float
    duration: float
    peak: float | None
    peak_time: float | None
    impulse: float | None
    point: Vector | None
    normal: Vector | None
    speed: float | None
    dominant: bool | None
    area: float | None
    ended: bool
    interrupted: bool
    transient: ExpectedImpact | None
    press: ClampingMetrics | None


@dataclass(frozen=True)
class HumanMetrics:
    """Effort, motion and contacts of the simulated human.

    Attributes:
        subject: code of the body.
        motion: begin and end of the motion, robot time [s].
        grips, handovers, carried: metrics of grips, of handovers, and of carried bodies.
        joints: load of each joint.
        strength_share_max, strength_share_mean: largest ratio of joint torque to strength, and its mean over time for
            the most loaded joint at each instant [1].
        muscles: metrics of the muscles; None: muscles do not drive the human.
        hand: motion of the hand.
        settling: decay after the motion; None: not assessed.
        contacts: contacts, in the order in which they ended.
        events: recorded events of the human, such as started or slipped.
    """

    subject: str
    motion: tuple[float, ...]
    grips: dict[str, GripMetrics]
    handovers: tuple[Handover, ...]
    carried: tuple[TransportMetrics, ...]
    joints: dict[str, JointLoad]
    strength_share_max: float
    strength_share_mean: float
    muscles: MusclesMetrics | None
    hand: HandMetrics
    settling: Settling | None
    contacts: tuple[ContactMetrics, ...]
    events: tuple[RecordedHumanEvent, ...]


def instability_reasons(settling: Settling | None) -> list[str]:
    """Return the reasons, as text, why the interaction of robot and human is unstable; empty: it is not."""
    if settling is None or settling.verdict != UNSTABLE:
        return []
    return [f"robot and human do not come to rest within {SETTLING_TIME:g} s after the motion: {settling.decay}"]
