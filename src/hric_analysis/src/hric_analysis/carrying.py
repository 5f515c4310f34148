"""Load sharing and internal force of two grips that carry a body together. No ROS.

The grips exert the forces f_a at p_a and f_b at p_b on the body; u is the unit vector from p_a to p_b. The internal
force ("squeeze") is the part of both forces that cancels along this line: min(f_a.u, -f_b.u) if both press, minus the
smaller magnitude if both pull, 0 if one pushes and the other yields. It does not contain the weight of a tilted body or
its inertia. This is the one-dimensional interactive force of two partners of Groten et al., RO-MAN 2009
(recalled, unconfirmed), along the line between the hands.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from hric_analysis.human_values import ShareSpread, TransportMetrics
from hric_assessment.ergonomics.effort import log_dimensionless_jerk
from hric_bags.reader import FloatArray
from hric_bags.records.human_record import GripRecord
from hric_bags.records.object_record import models
from hric_bags.run_file import NodeParameters
from hric_control.plants import WindowlessConfig
from hric_core.geometry import MassProperties
from hric_human.participant.settings import HumanSettings

ON_LINE = 1e-3
"""Maximum distance of a centre of mass from the line between both handles to count as on this line [m]; its motion then
follows from the motion of the handles (project default, unconfirmed)."""

EVEN = 0.02
"""Maximum relative difference of mean and median time step for which sampling counts as regular [1]: at most a few
samples are missing (project default, unconfirmed)."""
MIN_SAMPLES = 5
"""Minimum number of samples of a transport; needed to differentiate three times."""
TAKEN = 0.5
"""Time from the closing of the second grip until a body counts as carried [s]; a grip closes without force, so the body
falls a little first (project default, unconfirmed)."""


@dataclass(frozen=True)
class Transport:
    """Time series of a body while two grips carry it.

    Attributes:
        body: full name of the body.
        ends: names of both grips.
        time: robot time, shape (n,) [s].
        force: force of each grip on the body in the world frame, shape (2, n, 3) [N].
        point: point of action of each force, shape (2, n, 3) [m].
        squeeze: internal force, positive if the body is compressed, negative if it is stretched, shape (n,) [N].
        tilt: inclination of the line between both points, positive if the second is higher, shape (n,) [rad].
        weight: weight of the body [N]; None: not known.
        share: vertical force of each grip divided by the weight, shape (2, n) [1]; None: weight not known.
        excess: sum of both forces minus m (a - g), NaN at the start and end, shape (n, 3) [N]; None: the weight is not
            known, or the centre of mass is not on the line between both handles.
    """

    body: str
    ends: tuple[str, str]
    time: FloatArray
    force: FloatArray
    point: FloatArray
    squeeze: FloatArray
    tilt: FloatArray
    weight: float | None = None
    share: FloatArray | None = None
    excess: FloatArray | None = None

    @property
    def centre(self) -> FloatArray:
        """Midpoint between both points of action, shape (n, 3) [m]."""
        return np.asarray(self.point.mean(axis=0))


def masses(plant: NodeParameters) -> dict[str, MassProperties]:
    """Return the mass properties of the movable single-link bodies in a simulated world, by "model::link".

    The result is empty if the world file no longer exists.

    Args:
        plant: parameters of the plant (physics simulation).
    """
    return {
        f"{model.name}::{name}": link.mass
        for model in models(plant)
        if not model.fixed and len(model.tree.links) == 1
        for name, link in model.tree.links.items()
        if link.mass is not None
    }


def transports(grips: Iterable[GripRecord], human: NodeParameters, plant: NodeParameters) -> list[Transport]:
    """Return the transports of a run: bodies that two grips held at the same time, without a handover.

    Args:
        grips: grips of a run.
        human: section `human` of the experiment, which defines the handles.
        plant: parameters of the plant, which define the body's mass and gravity.
    """
    known, result = None, []
    for a, b in combinations(grips, 2):
        both = a.closed[: len(b.time)] & b.closed[: len(a.time)]
        if a.held != b.held or not both.any() or hands_over(a, b) or hands_over(b, a):
            continue
        known = masses(plant) if known is None else known
        gravity = np.array(plant.get("gravity") or WindowlessConfig().gravity, dtype=float)
        settings = HumanSettings.of(human, "human").grips
        handles = [settings[grip.name].handle for grip in (a, b) if grip.name in settings]
        if (during := _first_run(a.time, both)) is not None:
            result.append(_transport(a, b, during, known.get(a.held), handles, gravity))
    return result


def hands_over(giver: GripRecord, taker: GripRecord) -> bool:
    """Return True if the giver's grip both closed and opened before the taker's grip."""
    if not (giver.closed.any() and taker.closed.any()):
        return False
    (giver_from, taker_from), (giver_until, taker_until) = (
        [float(grip.time[grip.closed][k]) for grip in (giver, taker)] for k in (0, -1)
    )
    return giver_from < taker_from and giver_until < taker_until


def _first_run(time: FloatArray, both: npt.NDArray[np.bool_]) -> slice | None:
    """Return the samples from `TAKEN` after both grips have closed until one opens; None if they are too few."""
    closed = int(np.argmax(both))
    after = np.flatnonzero(~both[closed:])
    begin = int(np.searchsorted(time, time[closed] + TAKEN))
    end = closed + int(after[0]) if len(after) else len(both)
    return slice(begin, end) if end - begin >= MIN_SAMPLES else None


def _transport(
    a: GripRecord,
    b: GripRecord,
    during: slice,
    mass: MassProperties | None,
    handles: Sequence[Sequence[float]],
    gravity: FloatArray,
) -> Transport:
    time, force = _even(a.time[during]), -np.stack([a.force[during], b.force[during]])
    point = np.stack([a.point[during], b.point[during]])
    line = point[1] - point[0]
    length = np.linalg.norm(line, axis=1)
    along = line / length[:, None]
    press = np.stack([np.einsum("ij,ij->i", force[0], along), -np.einsum("ij,ij->i", force[1], along)])
    squeeze = np.clip(press.min(axis=0), 0.0, None) + np.clip(press.max(axis=0), None, 0.0)
    up = -gravity / np.linalg.norm(gravity)
    tilt = np.arcsin(np.clip(along @ up, -1.0, 1.0))
    common = a.held, (a.name, b.name), time, force, point, squeeze, tilt
    if mass is None:
        return Transport(*common)
    weight = mass.mass * float(np.linalg.norm(gravity))
    return Transport(*common, weight, force @ up / weight, _excess(time, force, point, mass, handles, gravity))


def _even(time: FloatArray) -> FloatArray:
    """Return evenly spaced times for samples taken at a fixed rate; unchanged if more than a few samples are missing.

    Stamps of an arm with a separate clock jitter by milliseconds; two derivatives would turn this into force errors.
    """
    steps = np.diff(time)
    if abs(float(steps.mean() / np.median(steps)) - 1.0) > EVEN:
        return time
    return np.linspace(time[0], time[-1], len(time))


def _excess(
    time: FloatArray,
    force: FloatArray,
    point: FloatArray,
    mass: MassProperties,
    handles: Sequence[Sequence[float]],
    gravity: FloatArray,
) -> FloatArray | None:
    if len(handles) < 2:
        return None
    first, second = np.array(handles, dtype=float)
    line, to_com = second - first, mass.com - first
    share = float(to_com @ line / (line @ line))
    if np.linalg.norm(to_com - share * line) > ON_LINE:
        return None
    com = (1.0 - share) * point[0] + share * point[1]
    acceleration = np.gradient(np.gradient(com, time, axis=0), time, axis=0)
    acceleration[:2] = acceleration[-2:] = np.nan  # one-sided differences are of first order
    return np.asarray(force.sum(axis=0) - mass.mass * (acceleration - gravity))


def metrics(transport: Transport, begin: float, end: float) -> TransportMetrics | None:
    """Return the metrics of a transport; None: the body was not carried during the person's motion.

    Args:
        transport: time series of the body.
        begin: start of the person's motion [s].
        end: end of the person's motion [s].
    """
    during = (transport.time >= begin) & (transport.time <= end)
    if during.sum() < MIN_SAMPLES:
        return None
    velocity = np.gradient(transport.centre, transport.time, axis=0)[during]
    height, squeeze, time = transport.centre[during, 2], transport.squeeze[during], transport.time
    shares, excess = transport.share, transport.excess
    size = None if excess is None or transport.weight is None else np.linalg.norm(excess, axis=1)[during]
    return TransportMetrics(
        transport.body,
        transport.weight,
        float(time[-1] - time[0]),
        None
        if shares is None
        else {name: _spread(share[during]) for name, share in zip(transport.ends, shares, strict=True)},
        float(squeeze.max(initial=0.0)),
        float(-squeeze.min(initial=0.0)),
        float(squeeze.mean()),
        float(np.abs(transport.tilt[during]).max()),
        float(np.trapezoid(np.linalg.norm(velocity, axis=1), time[during])),
        float(height.max() - height.min()),
        log_dimensionless_jerk(time[during], velocity),
        None if size is None else float(np.sqrt(np.nanmean(size**2))),
        None if size is None else float(np.nanmax(size)),
    )


def _spread(share: FloatArray) -> ShareSpread:
    return ShareSpread(float(share.mean()), float(share.min()), float(share.max()))
