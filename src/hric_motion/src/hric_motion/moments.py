"""Joint moments of a recorded person: inverse dynamics of the whole body, with the force plates under the feet.

Joints above the pelvis are computed from the head and the hands downwards and need no plate; those of a leg need the
load under its foot. The wrench that is left at the root link (the residual) shows how well motion, masses and plates
agree: without errors it would be zero.

    result = joint_moments(motion, trial.rate, trial.plates)
    result.moment                                 # shape (n, j) [N m]; NaN: not known
    result.residual_share                         # RMS of the residual force by the body weight [1]
    result.half_width                             # of the 95 % interval of each moment, shape (n, j) [N m]
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.ndimage import binary_dilation
from scipy.signal import butter, sosfiltfilt

from hric_core.errors import HricError, check_known
from hric_core.geometry import FloatArray
from hric_core.trial.plates import TrialPlate
from hric_human.body import Body, describe
from hric_human.body.segments import Builder
from hric_human.body.subject import LIGHTEST
from hric_human.control.kinematics import GRAVITY
from hric_human.control.whole_body import ExternalLoad, Needed, RootMotion, WholeBody
from hric_human.muscles.after_run import CUTOFF, FEWEST, RecordedMotion, of_root_too, smoothed
from hric_motion.measured import MeasuredMotion
from hric_motion.stances import NORMAL

LOADED = 20.0
"""Vertical force from which on a plate carries a foot [N], as gait laboratories use it; unconfirmed.

The other constants of this file are project defaults, unconfirmed, too.
"""
SLIGHT = 0.05
"""Peak of the vertical force, relative to the body weight, below which a load on a plate counts as noise [1]."""
REACH = 0.12
"""Largest mean distance of the centre of pressure from the axis of the foot on the plate [m]."""
SWING = 0.5
"""Speed from which on heel and toe of a foot do not touch the ground [m/s], of Ghoussayni et al. 2004 in table 1 of
Bonci et al. 2022 (doi:10.3389/fbioe.2022.868928)."""
LIGHT = 0.02
"""Largest share of the body's mass beyond a joint whose unknown angle is assumed at its middle [1]: foot, hand."""
EDGE = 0.1
"""Time at both ends of the motion in which filter and splines distort accelerations, and moments are not known [s]."""
LOST = 0.1
"""Residual force, relative to the body weight, above which the load under the feet counts as not measured [1]."""
RECOMMENDED, HICKS = 0.05, "Hicks et al. 2015"
"""Recommended limit of the residual force, relative to the largest external force [1] (J. Biomech. Eng. 137:020905)."""
MASS_DEVIATION, UNKNOWN_MASS_DEVIATION = 0.02, 0.15
"""Standard deviations of a stated mass of the body, and of an assumed one, relative to the mass [1]."""
LENGTH_DEVIATION = 0.02
"""Standard deviation of all fitted lengths of the body together, relative to the lengths [1]."""
NO_PLATES: Mapping[int, TrialPlate] = MappingProxyType({})

Mask = npt.NDArray[np.bool_]
FootEnds = Mapping[str, tuple[FloatArray, FloatArray]]
"""Positions of heel and toe, by the link of the foot, shape (n, 3) each [m]."""


@dataclass(frozen=True)
class JointMoments:
    """Moments of the j joints of a body at n instants.

    Attributes:
        body: body of the person.
        motion: smoothed motion of the joints; angles that are not known are interpolated, or at their middle.
        root: smoothed motion of the root link.
        moment: moment about the axis of each joint, positive as its angle, shape (n, j) [N m]; NaN: not known.
        needed: reactions between the links.
        residual: force [N] and moment [N m] about the root link's origin that the motion needs and no load gives, in
            axes of the laboratory, shape (n, 6).
        loads: loads on the links.
        standing: plates under each foot, by its link.
        supported: True where heels and toes that may touch the ground are on plates, and are so for EDGE before and
            after, shape (n,).
        notes: what was not used or not known, and why.
        deviation: standard deviations of the joint angles, shape (n, j) [rad].
        mass_deviation: standard deviation of the body's mass, by the mass [1].
        half_width: half-widths of the 95 % intervals of the moments, see `half_width_of`, shape (n, j) [N m].
        held: links with loads that move along, as a lifted object does.
        hands: load on the hands in words; empty: none.
    """

    body: Body
    motion: RecordedMotion
    root: RootMotion
    moment: FloatArray
    needed: Needed
    residual: FloatArray
    loads: tuple[ExternalLoad, ...]
    standing: Mapping[str, tuple[int, ...]]
    supported: Mask
    notes: tuple[str, ...]
    deviation: FloatArray
    mass_deviation: float
    half_width: FloatArray
    held: frozenset[str] = frozenset()
    hands: str = ""

    @property
    def residual_share(self) -> float:
        """RMS of the residual force, relative to the body weight [1], at the instants `supported`; NaN: there are none.

        These instants follow from plates and feet, not from the residual.
        """
        squares = (self.residual[self.supported, :3] ** 2).sum(axis=1)
        return float(np.sqrt(squares.mean()) / weight(self.body)) if len(squares) else float("nan")


class _Support(NamedTuple):
    """Loads of the plates on the feet.

    Attributes:
        loads: load of each plate on each foot that stood on it, at n instants.
        standing: plates under each foot, by its link.
        unclear: True where it is not known which foot loads a plate, shape (n,).
        notes: one sentence for each of these plates.
    """

    loads: list[ExternalLoad]
    standing: dict[str, tuple[int, ...]]
    unclear: Mask
    notes: list[str]


def weight(body: Body) -> float:
    """Return the weight of a body [N]."""
    return float(body.total_mass * np.linalg.norm(GRAVITY))


def joint_moments(
    motion: MeasuredMotion,
    rate: float,
    plates: Mapping[int, TrialPlate] = NO_PLATES,
    loads: Sequence[ExternalLoad] = (),
    cutoff: float = CUTOFF,
    mass_deviation: float = MASS_DEVIATION,
    held: frozenset[str] = frozenset(),
) -> JointMoments:
    """Compute the joint moments of a motion.

    Args:
        motion: motion of the person.
        rate: rate of its frames [Hz].
        plates: force plates of the trial, by number, in the laboratory of the markers.
        loads: further loads on links, such as a wrench on a hand, at the instants of the result.
        cutoff: cut-off of the low-pass filter of motion and plates [Hz].
        mass_deviation: standard deviation of the body's mass, by the mass [1].
        held: links with further loads that move along with them; the other loads are at rest in the laboratory.

    Raises:
        HricError: the pose of the person is known in too few successive frames.
    """
    rows = longest_known(motion)
    notes = [f"only frames {rows.start + 1} to {rows.stop} are used: in others the pose is not known"]
    time, whole = np.arange(rows.start, rows.stop) / rate, WholeBody(motion.body)
    posture = np.hstack([_filled(motion, rows), _continuous(motion.root[rows])])
    smooth, root = of_root_too(smoothed(time, posture, cutoff), motion.q.shape[1])
    feet = _foot_ends(whole, whole.inverse_dynamics(smooth.q, smooth.dq, smooth.ddq, root))
    support = _support(feet, weight(motion.body), smooth.time, plates, cutoff)
    needed = whole.inverse_dynamics(smooth.q, smooth.dq, smooth.ddq, root, [*support.loads, *loads])
    residual = _residual(whole, needed, root)
    lost = support.unclear | (np.linalg.norm(residual[:, :3], axis=1) > LOST * weight(motion.body))
    nearest = np.round((smooth.time - time[0]) * rate).astype(int)
    ends = np.minimum(smooth.time - smooth.time[0], smooth.time[-1] - smooth.time) < EDGE
    unknown = _unknown(whole, np.isnan(motion.q[rows][nearest]), lost, {one.link for one in loads}) | ends[:, None]
    if lost.any():
        notes.append(f"the load under the feet is not known in {lost.mean():.0%} of the time")
    moment, remarks = np.where(unknown, np.nan, needed.torque), (*notes[len(time) == len(motion.q) :], *support.notes)
    supported = ~(ends | _doubtful(feet, smooth.time, plates, support.unclear))
    acting = (*support.loads, *loads), support.standing, supported, remarks
    deviations = motion.spread[rows][nearest], mass_deviation, np.zeros_like(moment)
    result = JointMoments(motion.body, smooth, root, moment, needed, residual, *acting, *deviations, held)
    return replace(result, half_width=half_width_of(result, lambda varied: varied.moment))


def half_width_of(moments: JointMoments, quantity: Callable[[JointMoments], FloatArray]) -> FloatArray:
    """Return the half-width of the 95 % interval of a quantity, in its shape and unit; NaN where it is not known.

    The variance is the sum of the squared changes by one standard deviation of each joint angle, of the mass and of the
    lengths (first order, as independent). The error of an angle counts as constant over time, so that it moves a
    joint's lever arms, and not the accelerations. Loads on feet and hands, and the pose of the root, count as exact.

    Args:
        moments: joint moments.
        quantity: function that returns the quantity for moments; called once for each standard deviation.
    """
    middle = quantity(moments)
    variance = np.zeros_like(middle)
    for varied in _varied(moments):
        variance += (quantity(varied) - middle) ** 2
    return np.asarray(NORMAL * np.sqrt(variance))


def _varied(moments: JointMoments) -> Iterator[JointMoments]:
    """Yield the moments for an error of one standard deviation of each joint angle, of the mass, and of the lengths."""
    subject, motion = moments.body.subject, moments.motion
    for column in np.flatnonzero((moments.deviation != 0.0).any(axis=0)):
        q = motion.q.copy()
        q[:, column] += moments.deviation[:, column]
        yield _with(moments, moments.body, q)
    lengths = {name: (1.0 + LENGTH_DEVIATION) * value for name, value in Builder(subject).lengths.items()}
    lighter, heavier = ((1.0 + sign * moments.mass_deviation) * subject.mass for sign in (-1.0, 1.0))
    for changed in ({"mass": lighter if lighter >= LIGHTEST else heavier}, {"lengths": lengths}):
        yield _with(moments, describe(replace(subject, **changed)), motion.q)  # a body that heavier arms may not fit


def _with(moments: JointMoments, body: Body, q: FloatArray) -> JointMoments:
    """Return the moments of another body, or of other joint angles, under the same loads."""
    motion, loads, whole = moments.motion, list(moments.loads), WholeBody(body)
    if moments.held:
        free = whole.inverse_dynamics(q, motion.dq, motion.ddq, moments.root)
        loads = [_followed(load, moments.needed, free, whole.index) for load in loads if load.link in moments.held]
        loads += [load for load in moments.loads if load.link not in moments.held]
    needed = whole.inverse_dynamics(q, motion.dq, motion.ddq, moments.root, loads)
    known = np.where(np.isfinite(moments.moment), needed.torque, np.nan)
    return replace(moments, body=body, moment=known, needed=needed)


def _followed(load: ExternalLoad, before: Needed, after: Needed, index: Mapping[str, int]) -> ExternalLoad:
    """Return a load whose point has moved along with its link from one posture to another."""
    at = index[load.link]
    p_link = np.einsum("nji,nj->ni", before.rotation[:, at], load.point - before.position[:, at])
    return load._replace(point=after.position[:, at] + np.einsum("nij,nj->ni", after.rotation[:, at], p_link))


def joint_force(moments: JointMoments, joint: str) -> FloatArray:
    """Return the net force that the parent link exerts on the link that a joint moves, in axes of the moved link.

    Returns:
        the force, shape (n, 3) [N], NaN where the moment of the joint is not known.

    Raises:
        HricError: the body has no such joint.
    """
    check_known("joint", [joint], moments.body.joints, "the body")
    column = list(moments.body.joints).index(joint)
    links = enumerate(WholeBody(moments.body).links)
    at = next(at for at, link in links if any(link.axis) and link.joint == column)
    force = np.einsum("nji,nj->ni", moments.needed.rotation[:, at], moments.needed.force[:, at])
    return np.where(np.isfinite(moments.moment[:, [column]]), force, np.nan)


def longest_known(motion: MeasuredMotion) -> slice:
    """Return the longest range of frames in which the pose of the person is known.

    Raises:
        HricError: it has fewer frames than the smoothing needs.
    """
    known = intervals(np.asarray(np.isfinite(motion.root).all(axis=1)))
    rows = max(known, key=lambda rows: rows.stop - rows.start, default=slice(0, 0))
    if (count := rows.stop - rows.start) < FEWEST:
        raise HricError(f"the pose of the person is known in {count} successive frames; valid: {FEWEST} or more")
    return rows


def _filled(motion: MeasuredMotion, rows: slice) -> FloatArray:
    """Return joint positions without gaps, shape (n, j) [rad]: interpolated, or in the middle of the joint's range."""
    columns, frames = [], np.arange(rows.stop - rows.start)
    for column, joint in zip(motion.q[rows].T, motion.body.joints.values(), strict=True):
        known = np.isfinite(column)
        middle = np.full(len(frames), np.clip(0.0, *joint.range))
        columns.append(np.interp(frames, frames[known], column[known]) if known.any() else middle)
    return np.column_stack(columns)


def _continuous(root: FloatArray) -> FloatArray:
    """Return poses whose quaternions (x, y, z, w) do not change their sign from one frame to the next, shape (n, 7)."""
    q = root[:, 3:]
    flips = np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    return np.hstack([root[:, :3], q * np.cumprod(np.concatenate([[1.0], flips]))[:, None]])


def _residual(whole: WholeBody, needed: Needed, root: RootMotion) -> FloatArray:
    """Return force and moment about the origin of the massless root link that its neighbours need, shape (n, 6)."""
    total = np.zeros((len(root.position), 6))
    for at, link in enumerate(whole.links):
        if link.parent < 0:
            arm = needed.position[:, at] - root.position
            total[:, :3] += needed.force[:, at]
            total[:, 3:] += needed.moment[:, at] + np.cross(arm, needed.force[:, at])
    return total


def _unknown(whole: WholeBody, unseen: Mask, lost: Mask, loaded: set[str]) -> Mask:
    """Return True for moments that are not known, shape (n, j).

    Args:
        whole: links of the body.
        unseen: True for angles that are not known, shape (n, j).
        lost: True where the load under the feet is not known, shape (n,).
        loaded: links with further loads, whose lever arms depend on the joints before them.
    """
    masses = {segment.link: segment.mass.mass for segment in whole.body.segments.values()}
    feet = {segment.link for segment in whole.body.segments.values() if segment.kind == "foot"}
    unknown = unseen.copy()
    moved = [link for link in whole.links if any(link.axis)]
    chains = {link.joint: set(_towards_root(whole, link.name)) for link in whole.links if any(link.axis)}
    for link in moved:
        beyond = {name for name in whole.index if link.name in _path(whole, name)}
        if sum(masses.get(name, 0.0) for name in beyond) > LIGHT * whole.body.total_mass or beyond & loaded:
            others = chains[link.joint] | {other.joint for other in moved if other.name in beyond}
            unknown[:, list(others)] |= unseen[:, [link.joint]]
        if beyond & feet:
            unknown[:, link.joint] |= lost
    return unknown


def _path(whole: WholeBody, name: str) -> Iterator[str]:
    """Yield a link and those between it and the root."""
    at = whole.index[name]
    while at >= 0:
        yield whole.links[at].name
        at = whole.links[at].parent


def _towards_root(whole: WholeBody, name: str) -> Iterator[int]:
    """Yield the indices of the joints between a link and the root."""
    for passed in _path(whole, name):
        link = whole.links[whole.index[passed]]
        if any(link.axis):
            yield link.joint


def _foot_ends(whole: WholeBody, free: Needed) -> FootEnds:
    """Return the positions of heel and toe of each foot; free: positions of the links."""
    ends = {}
    for segment in whole.body.segments.values():
        if segment.kind == "foot":
            at = whole.index[segment.link]
            heel, toe = (free.position[:, at] + free.rotation[:, at] @ end for end in (segment.start, segment.end))
            ends[segment.link] = heel, toe
    return ends


def _doubtful(feet: FootEnds, time: FloatArray, plates: Mapping[int, TrialPlate], unclear: Mask) -> Mask:
    """Return True within EDGE of instants at which a support without a plate may carry the person, shape (n,).

    That is a heel or toe that is slow and not on a plate, or a plate whose foot is not clear.
    """
    ends = [end for both in feet.values() for end in both]
    if not ends:
        return np.ones(len(time), bool)
    doubtful = unclear.copy()
    for end in ends:
        slow = np.linalg.norm(np.gradient(end, time, axis=0), axis=1) < SWING
        on = np.zeros(len(time), bool)
        for plate in plates.values():
            p_plate = (end - plate.T_lab_plate[:3, 3]) @ plate.T_lab_plate[:3, :3]
            on |= (np.abs(p_plate[:, :2]) <= 0.5 * np.array(plate.size)).all(axis=1)
        doubtful |= slow & ~on
    return np.asarray(binary_dilation(doubtful, iterations=round(EDGE / (time[1] - time[0]))))


def _support(
    feet: FootEnds, body_weight: float, time: FloatArray, plates: Mapping[int, TrialPlate], cutoff: float
) -> _Support:
    """Return the loads of the force plates on the feet.

    Args:
        feet: positions of heel and toe of each foot.
        body_weight: weight of the person [N]; a load below a share SLIGHT of it is ignored.
        time: instants of the trial, shape (n,) [s].
        plates: force plates by number.
        cutoff: cut-off frequency of the low-pass filter of the loads [Hz].
    """
    support = _Support([], {link: () for link in feet}, np.zeros(len(time), bool), [])
    for number, plate in plates.items():
        load = plate.loads(time)
        carried: dict[str, Mask] = {}
        for rows in intervals(-load[:, 2] > LOADED):
            if -load[rows, 2].min() < SLIGHT * body_weight:
                continue
            foot = _foot(feet, rows, _pressure(plate, load))
            if foot is None:
                support.unclear[rows] = True
                span = f"from {time[rows.start]:.2f} s to {time[rows.stop - 1]:.2f} s"
                support.notes.append(f"force plate {number}: it is not known which foot loads it {span}")
                continue
            carried.setdefault(foot, np.zeros(len(time), bool))[rows] = True
        for link, mask in carried.items():
            support.loads.append(plate_load(plate, link, mask, time, cutoff))
            support.standing[link] += (number,)
    return support


def intervals(mask: Mask) -> Iterator[slice]:
    """Yield the ranges of successive True values; mask: shape (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(begin), int(end))


def _pressure(plate: TrialPlate, load: FloatArray) -> FloatArray:
    """Return the centre of pressure in the laboratory, shape (n, 3) [m]; NaN: the plate is not loaded."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = -load[:, 4] / load[:, 2], load[:, 3] / load[:, 2]
    p_plate = np.column_stack([x, y, np.zeros(len(load))])
    return np.asarray(p_plate @ plate.T_lab_plate[:3, :3].T + plate.T_lab_plate[:3, 3])


def _foot(feet: FootEnds, rows: slice, pressure: FloatArray) -> str | None:
    """Return the foot under which the pressure is; None: none, or both.

    pressure: centre of pressure, shape (n, 3) [m].
    """
    near = []
    for link, (heel, toe) in feet.items():
        along, to = toe[rows] - heel[rows], pressure[rows] - heel[rows]
        share = np.clip((along * to).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        if np.linalg.norm(to - share[:, None] * along, axis=1).mean() < REACH:
            near.append(link)
    return near[0] if len(near) == 1 else None


def plate_load(plate: TrialPlate, link: str, mask: Mask, time: FloatArray, cutoff: float) -> ExternalLoad:
    """Return the reaction of a plate on a link, filtered as the motion is, about the middle of the plate.

    mask: True while the link is on the plate, at instants `time`, shape (n,).
    """
    samples = np.arange(len(plate.load)) / plate.rate
    on = np.interp(samples, time, mask.astype(float), left=0.0, right=0.0) > 0.5
    filtered = sosfiltfilt(butter(2, cutoff, fs=plate.rate, output="sos"), -plate.load * on[:, None], axis=0)
    wrench = replace(plate, load=np.asarray(filtered)).loads(time)
    R, middle = plate.T_lab_plate[:3, :3], plate.T_lab_plate[:3, 3]
    return ExternalLoad(link, wrench[:, :3] @ R.T, wrench[:, 3:] @ R.T, np.tile(middle, (len(time), 1)))
