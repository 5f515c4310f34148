"""Muscle load of a motion after the run, from recorded joint angles and forces on the hands.

    load = AfterRun(body, muscles, anatomy, T_world_root).of(smoothed(time, q), loads)
    load.activation, load.contact["right_shoulder"], load.share

Angles are smoothed and differentiated; inverse dynamics gives the joint torques, from inertia, gravity and the forces
on the hands; static optimisation shares them among muscles at each instant separately, without activation dynamics and
co-contraction. All results are model estimates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, Vector
from hric_human.body import Body
from hric_human.control.kinematics import GRAVITY
from hric_human.control.strength import strength
from hric_human.control.whole_body import ExternalLoad, RootMotion, WholeBody
from hric_human.muscles.anatomy import Anatomy
from hric_human.muscles.joint_contact import JointContact
from hric_human.muscles.muscle_set import MuscleSet
from hric_human.muscles.static_optimization import StaticOptimization

RATE = 100.0
"""Rate of the computed instants [Hz]; project default."""
CUTOFF = 6.0
"""Cut-off of the low-pass filter of angles [Hz], a second-order Butterworth filter run forwards and backwards.

Value of OpenSim's tutorials; Winter, Biomechanics and Motor Control of Human Movement, uses 4 to 8 Hz for people.
"""
DEGREE = 5
"""Degree of the splines through joint angles; at this degree their second derivatives are smooth."""
FEWEST = 20
"""Minimum number of samples of a motion; a shorter one consists of the filter's end effects only."""


@dataclass(frozen=True)
class RecordedMotion:
    """Smoothed motion of j joints at n instants.

    Attributes:
        time: evenly spaced times, shape (n,) [s].
        q, dq, ddq: positions, velocities, accelerations, shape (n, j) each [rad], [rad/s], [rad/s^2].
    """

    time: FloatArray
    q: FloatArray
    dq: FloatArray
    ddq: FloatArray


@dataclass(frozen=True)
class MuscleLoad:
    """Load of k muscles and ideal actuators, of the m joints that they move, and of the joint centres, at n instants.

    Attributes:
        time: times, shape (n,) [s].
        names: names of muscles and actuators.
        is_muscle: True for a muscle, False for an actuator, in the order of `names`.
        joints: names of the joints.
        activation: activations, shape (n, k) [1].
        force: force of muscles along their lines of action [N], torque of actuators [N m], shape (n, k).
        torque: joint torques, shape (n, m) [N m].
        share: ratio of each joint torque's magnitude to the strength in its direction, shape (n, m) [1].
        shortfall: part of the torque that the muscles cannot produce, shape (n, m) [N m].
        contact: force of the proximal on the distal bone, in axes of the world, by joint centre, shape (n, 3) [N].
        centres: positions of the joint centres in the world, by joint centre, shape (n, 3) [m].
        outside: True if the posture is outside the range of the fitted muscle paths, by side, shape (n,); muscle values
            are then those at the edge of the range.
        lost: True if motion or hand force was not measured, by side, shape (n,); all values are then NaN. Empty: all
            was measured.
    """

    time: FloatArray
    names: tuple[str, ...]
    is_muscle: tuple[bool, ...]
    joints: tuple[str, ...]
    activation: FloatArray
    force: FloatArray
    torque: FloatArray
    share: FloatArray
    shortfall: FloatArray
    contact: Mapping[str, FloatArray]
    centres: Mapping[str, FloatArray]
    outside: Mapping[str, NDArray[np.bool_]]
    lost: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)

    def known(self, name: str) -> NDArray[np.bool_]:
        """Return True for instants at which the load of a muscle or joint is measured and in the fitted range.

        Args:
            name: name of the muscle or joint, with its side.
        """
        side = name.partition("_")[0]
        return ~(self.outside[side] | self.lost[side] if self.lost else self.outside[side])


def smoothed(time: FloatArray, q: FloatArray, cutoff: float | None = CUTOFF, rate: float = RATE) -> RecordedMotion:
    """Smooth recorded joint angles and compute their derivatives.

    The filter needs evenly spaced samples, so a spline resamples first, at the mean rate of the recording. The first
    and the last 0.1 s of the result are distorted by the filter and the splines.

    Args:
        time: increasing times, shape (n,) [s].
        q: joint positions, shape (n, j) [rad].
        cutoff: cut-off of the low-pass filter [Hz]; None: unfiltered.
        rate: rate of the result [Hz].

    Raises:
        HricError: the recording is too short, its times do not increase, an angle is not finite, or the cut-off is
            above half of the sample rate.
    """
    from scipy.interpolate import make_interp_spline  # slow to import, and needed only if there is a motion
    from scipy.signal import butter, sosfiltfilt

    if len(time) < FEWEST or not bool(np.all(np.diff(time) > 0.0)) or not np.isfinite(q).all():
        raise HricError(
            f"a motion of {len(time)} samples cannot be smoothed; valid: {FEWEST} samples or more, increasing times, "
            "finite angles"
        )
    span = float(time[-1] - time[0])
    even = np.linspace(time[0], time[-1], len(time))
    values = make_interp_spline(time, q, DEGREE)(even)
    sampled = (len(time) - 1) / span
    if cutoff is not None:
        if not 0.0 < cutoff < 0.5 * sampled:
            raise HricError(
                f"the cut-off of the filter is {cutoff} Hz; valid: above 0, below half of the sample rate of "
                f"{sampled:.1f} Hz"
            )
        values = sosfiltfilt(butter(2, cutoff, fs=sampled, output="sos"), values, axis=0)
    curve = make_interp_spline(even, values, DEGREE)
    instants = np.minimum(time[0] + np.arange(int(span * rate + 1e-6) + 1) / rate, time[-1])
    return RecordedMotion(instants, *(np.asarray(curve(instants, derivative)) for derivative in range(3)))


def of_root_too(motion: RecordedMotion, joints: int) -> tuple[RecordedMotion, RootMotion]:
    """Split a motion into that of the joints and that of the root link.

    Args:
        motion: motion whose first columns are the joints and whose last seven are the root's position and quaternion
            (x, y, z, w), not necessarily of unit length.
        joints: number of joints.
    """
    q, dq, ddq = motion.q, motion.dq, motion.ddq
    here, quaternion = slice(joints, joints + 3), slice(joints + 3, joints + 7)
    turned = q[:, quaternion]
    root = RootMotion(
        q[:, here],
        turned / np.linalg.norm(turned, axis=1, keepdims=True),
        _turning(turned, dq[:, quaternion]),
        _turning(turned, ddq[:, quaternion]),
        ddq[:, here],
    )
    return RecordedMotion(motion.time, *(np.ascontiguousarray(columns[:, :joints]) for columns in (q, dq, ddq))), root


def _turning(q: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the vector part of 2 rate q^-1 for quaternions of shape (n, 4); result of shape (n, 3).

    It is the angular velocity if `rate` is the first derivative of q, the angular acceleration if it is the second.
    """
    v, w, dv, dw = q[:, :3], q[:, 3:], rate[:, :3], rate[:, 3:]
    return np.asarray(2.0 * (w * dv - dw * v - np.cross(dv, v)) / (q * q).sum(axis=1, keepdims=True))


class AfterRun:
    """Computation of a body's muscle load over a recorded motion.

    Args:
        body: body with the muscles.
        muscles: muscles of the body.
        anatomy: fitted muscle model, for the muscles' forces on the joints.
        T_world_root: pose of the body's root link, if it is at rest.
        gravity: gravity vector in axes of the world [m/s^2].

    Attributes:
        names: names of muscles and actuators.
        joints: names of the joints that muscles and actuators move.
        links: links on which the joint contact forces act, by joint centre.
    """

    def __init__(
        self, body: Body, muscles: MuscleSet, anatomy: Anatomy, T_world_root: Pose, gravity: Vector = GRAVITY
    ) -> None:
        self._dynamics, self._muscles, self._root, self._gravity = WholeBody(body), muscles, T_world_root, gravity
        self._anatomy = anatomy
        self._contact = JointContact(self._dynamics, anatomy, muscles.names)
        low, high = strength(body)
        self._strength = np.array([low, high])[:, list(muscles.joints)]
        self.names, self.links = muscles.names, self._contact.links
        self.joints = tuple(list(body.joints)[index] for index in muscles.joints)

    def of(
        self, motion: RecordedMotion, loads: Sequence[ExternalLoad] = (), root: RootMotion | None = None
    ) -> MuscleLoad:
        """Return the muscle load over a motion.

        Args:
            motion: motion of all joints of the body.
            loads: external loads on the body's links, at the instants of the motion.
            root: motion of the root link, at the same instants; None: at rest.

        Raises:
            HricError: a load on a link that the body does not have.
        """
        where = self._root if root is None else root
        needed = self._dynamics.inverse_dynamics(motion.q, motion.dq, motion.ddq, where, loads, self._gravity)
        torque = needed.torque[:, list(self._muscles.joints)]
        activation, force, shortfall = self._shared(motion, torque)
        low, high = self._strength
        return MuscleLoad(
            motion.time,
            self.names,
            self._muscles.is_muscle,
            self.joints,
            activation,
            force,
            torque,
            torque / np.where(torque < 0.0, low, high),
            shortfall,
            self._contact.over(motion.q, where, needed, force),
            {name: needed.position[:, self._dynamics.index[link]] for name, link in self._contact.links.items()},
            self._outside(motion.q),
        )

    def _outside(self, q: FloatArray) -> dict[str, NDArray[np.bool_]]:
        """Return True for instants with an angle beyond the range of the fitted muscle paths, by side."""
        order, anatomy = list(self._dynamics.body.joints), self._anatomy
        outside = dict[str, NDArray[np.bool_]]()
        for side in {name.partition("_")[0]: None for name in self.joints}:
            angles = q[:, [order.index(f"{side}_{joint}") for joint in anatomy.joints]]
            outside[side] = np.any((angles < anatomy.lower) | (angles > anatomy.upper), axis=1)
        return outside

    def _shared(self, motion: RecordedMotion, torque: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Share the joint torque [N m] among the muscles; return activation, force and shortfall at all instants."""
        n, k = len(motion.time), len(self._muscles.names)
        solver = StaticOptimization(k, len(self.joints))
        activation, force, shortfall = np.empty((n, k)), np.empty((n, k)), np.empty((n, len(self.joints)))
        for t, (q, dq, tau) in enumerate(zip(motion.q.tolist(), motion.dq.tolist(), torque, strict=True)):
            state = self._muscles.at(q, dq)
            solution = solver.solve(state.arms, state.gain, tau - state.passive @ state.arms)
            activation[t], force[t] = solution.activation, state.forces(solution.activation)
            shortfall[t] = solution.shortfall
        return activation, force, shortfall
