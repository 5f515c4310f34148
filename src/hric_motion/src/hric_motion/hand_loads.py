"""Loads on the hands of a person in a trial: a lifted object, or a force plate of the file that is a handle.

    load = HandLoad(("right", "left"), mass=12.0, begin=1.0, end=3.0)
    result = loaded_moments(motion, trial, load)         # joint moments with the load

An object of mass m is a force m (g - a) at the hand's centre of mass, with the acceleration a of this point; both hands
carry a half each. Its moment of inertia and its place in the hand are left out. A handle is held for the whole trial.
"""

from dataclasses import dataclass, replace

import numpy as np

from hric_core.errors import ParameterError
from hric_core.trial.c3d import Trial
from hric_human.body.segments import SIDES
from hric_human.control.kinematics import GRAVITY
from hric_human.control.whole_body import ExternalLoad, WholeBody
from hric_human.muscles.after_run import CUTOFF
from hric_motion.live_load import REACH
from hric_motion.measured import MeasuredMotion
from hric_motion.moments import LOADED, MASS_DEVIATION, JointMoments, joint_moments, plate_load

HEAVIEST = 100.0
"""Largest mass of a lifted object [kg]; project default, unconfirmed."""


@dataclass(frozen=True)
class HandLoad:
    """Load on one or both hands.

    Attributes:
        sides: loaded hands.
        mass: mass of a lifted object [kg]; 0: `plate` is the handle.
        plate: number of the force plate in the file that is the handle.
        begin, end: time of the trial from which and up to which the object is lifted [s]; None: from or to its end.

    Raises:
        ParameterError: the mass or the times are out of range, or both hands hold the handle.
    """

    sides: tuple[str, ...]
    mass: float = 0.0
    plate: int = 0
    begin: float | None = None
    end: float | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        begin, end = self._interval
        if not (0.0 < self.mass <= HEAVIEST or (self.plate > 0 and self.mass == 0.0)):
            raise ParameterError(f"the lifted mass is {self.mass:g} kg; valid: above 0, up to {HEAVIEST:g} kg")
        if not begin < end:
            raise ParameterError(
                f"the object is lifted from {begin:g} s to {end:g} s; valid: a beginning before the end"
            )
        if self.plate and len(self.sides) > 1:
            raise ParameterError("both hands hold the handle; valid: right or left, as their shares are not measured")

    @property
    def _interval(self) -> tuple[float, float]:
        return -np.inf if self.begin is None else self.begin, np.inf if self.end is None else self.end

    def __str__(self) -> str:
        """Return the load in words."""
        hands = "both hands" if len(self.sides) > 1 else f"the {self.sides[0]} hand"
        if self.plate:
            return f"force plate {self.plate} as a handle in {hands}"
        ends = "".join(f" {word} {at:g} s" for word, at in (("from", self.begin), ("to", self.end)) if at is not None)
        return f"{self.mass:g} kg in {hands}{ends}"

    def loads(self, alone: JointMoments, trial: Trial) -> list[ExternalLoad]:
        """Return the loads on the links of the hands.

        Args:
            alone: moments of the motion in the trial without the load.
            trial: trial with the handle.

        Raises:
            ParameterError: the object is never lifted in the motion, or the loaded handle is not near the hand.
        """
        time, whole, made = alone.motion.time, WholeBody(alone.body), list[ExternalLoad]()
        begin, end = self._interval
        lifted = (time + trial.start >= begin) & (time + trial.start <= end)
        if not lifted.any():
            span = f"{time[0] + trial.start:g} to {time[-1] + trial.start:g} s"
            raise ParameterError(f"the object is lifted from {begin:g} s to {end:g} s; the motion is known from {span}")
        for side in self.sides:
            hand = alone.body.segments[f"{side}_hand"]
            at = whole.index[hand.link]
            point = alone.needed.position[:, at] + alone.needed.rotation[:, at] @ hand.mass.com
            if self.plate:
                load = plate_load(trial.plate(self.plate), hand.link, np.ones(len(time), bool), time, CUTOFF)
                away = np.linalg.norm(load.point - point, axis=1)[np.linalg.norm(load.force, axis=1) > LOADED]
                if (away > REACH).any():
                    raise ParameterError(
                        f"force plate {self.plate} is loaded {away.max():.2f} m from the {side} hand; valid for a "
                        f"handle: up to {REACH:g} m"
                    )
                made.append(load)
                continue
            acceleration = np.gradient(np.gradient(point, time, axis=0), time, axis=0)
            force = self.mass / len(self.sides) * (np.array(GRAVITY) - acceleration) * lifted[:, None]
            made.append(ExternalLoad(hand.link, force, np.zeros_like(point), point))
        return made


def hand_load(
    hand: str | None, mass: float | None, plate: int | None, begin: float | None = None, end: float | None = None
) -> HandLoad | None:
    """Return the load on the hands that the command-line options state; None: they state none.

    Args:
        hand: right, left or both.
        mass: mass of a lifted object [kg].
        plate: number of the force plate that is a handle.
        begin: time from which the object is lifted [s].
        end: time up to which it is lifted [s].

    Raises:
        ParameterError: the options are not complete, contradict each other, or are out of range.
    """
    if mass is None and plate is None:
        if hand is None and begin is None and end is None:
            return None
        raise ParameterError("--hand, --from and --to need a load; valid: with --load KG or --handle PLATE")
    if hand is None or (mass is not None and plate is not None):
        raise ParameterError(
            "the load on the hands is not clear; valid: --hand, and one of --load KG and --handle PLATE"
        )
    if plate is not None and (plate < 1 or begin is not None or end is not None):
        raise ParameterError(f"--handle is {plate}; valid: the number of a force plate, without --from and --to")
    sides = tuple(SIDES) if hand == "both" else (hand,)
    return HandLoad(sides, 0.0 if mass is None else mass, plate or 0, begin, end)


def loaded_moments(
    motion: MeasuredMotion, trial: Trial, load: HandLoad | None = None, mass_deviation: float = MASS_DEVIATION
) -> JointMoments:
    """Return the joint moments of a motion with the force plates of its trial and a load on the hands.

    Args:
        motion: motion of the person.
        trial: trial of the motion.
        load: load on the hands; None: there is none.
        mass_deviation: standard deviation of the body's mass, by the mass [1].

    Raises:
        HricError: the load does not fit the trial, or the pose of the person is known in too few successive frames.
    """
    plates = dict(trial.plates)
    if load is not None and load.plate:
        trial.plate(load.plate)
        del plates[load.plate]
    alone = joint_moments(motion, trial.rate, plates, mass_deviation=mass_deviation)
    if load is None:
        return alone
    loads = load.loads(alone, trial)
    held = frozenset() if load.plate else frozenset(one.link for one in loads)
    result = joint_moments(motion, trial.rate, plates, loads, mass_deviation=mass_deviation, held=held)
    return replace(result, hands=str(load))
