"""Stability verdict of the control loop of a run.

A run is unstable if the simulation diverged, if the arm stopped with `instability_detected`, if human and robot do not
come to rest after the person's motion (`human.unrest`), or if a joint chatters, which is defined here.

The joint torque tau_k of cycle k is the requested torque of an effort-controlled joint, else the measured torque. The
log is cut into pieces of PIECE cycles. r_k is tau_k minus its least-squares parabola over the piece, which removes
motion and gravity and leaves periods of up to about half a piece. For each stretch of STRETCH consecutive pieces
    ripple      = smallest RMS of r over one of its pieces [N m], so that shorter disturbances do not count,
    share       = ripple / effort limit of the joint,
    c_L         = sum r_k r_(k+L) / sum r_k^2 * PIECE / (PIECE - L), the autocorrelation at a lag of L cycles, with both
                  sums over all pieces,
    periodicity = largest min(-c_l, c_L) of lags l < L: near 1 for an oscillation with a period of L cycles, near 0 for
                  noise.
A joint chatters if share >= CHATTER_SHARE and periodicity >= PERIODICITY, or if share >= WILD_SHARE.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from hric_bags.reader import ControlRecord
from hric_bags.run_file import RunFile
from hric_control.plants import DivergedError

FloatArray = npt.NDArray[np.float64]
PIECE = 25
"""Number of cycles of a piece; at 1 kHz oscillations above about 60 Hz remain. Default chosen by this project,
unconfirmed."""
STRETCH = 10
"""Number of pieces for which chatter must last: 0.25 s at 1 kHz, longer than the oscillation of a contact. Default
chosen by this project, unconfirmed."""
LAGS = 12
"""Longest period of chatter that is searched for [cycles]. Default chosen by this project, unconfirmed."""
CHATTER_SHARE = 0.02
"""RMS of periodic ripple relative to the effort limit from which a joint chatters [1]. Default chosen by this project,
unconfirmed: a torque of a Panda's wrist that changes its sign each cycle at the rate limit of 1000 N m/s has 0.042;
stable loops have at most 0.001, a loop that presses with friction on a stiff block 0.006."""
PERIODICITY = 0.5
"""Periodicity from which ripple is periodic [1]. Default chosen by this project, unconfirmed: chatter has 0.5 to 1,
noise less than 0.3."""
WILD_SHARE = 0.1
"""RMS of ripple relative to the effort limit from which a joint chatters even without a period [1]. Default chosen by
this project, unconfirmed: noise of a Panda's measured speed (6e-3 rad/s) times a gain of 100 N m s/rad has 0.05."""
NO_LIMIT_EFFORT = 100.0
"""Effort limit assumed for a joint without one [N m or N]. Default chosen by this project, unconfirmed."""
_SAME_PERIOD = 0.9
"""Share of the largest periodicity from which a shorter lag is taken as the period [1]."""
STABLE, UNSTABLE = "stable", "unstable"
ARM_ERROR = "instability_detected"
"""libfranka's name of the error with which the arm reports an instability."""


@dataclass(frozen=True)
class Stretches:
    """Ripple and periodicity of n stretches and j joints.

    Attributes:
        ripple: RMS ripple, shape (n, j) [N m].
        periodicity: periodicity, shape (n, j) [1].
        period: lag of the periodicity, shape (n, j) [cycles].
    """

    ripple: FloatArray
    periodicity: FloatArray
    period: npt.NDArray[np.intp]


def stretches(torque: FloatArray) -> Stretches:
    """Return ripple and periodicity of each stretch of the run.

    Args:
        torque: joint torques of each cycle, shape (n, j) [N m]; at least PIECE * STRETCH cycles.
    """
    pieces = len(torque) // PIECE
    parts = torque[: pieces * PIECE].reshape(pieces, PIECE, -1)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, PIECE), 3))
    residue = parts - np.einsum("ki,li,plj->pkj", basis, basis, parts, optimize=True)
    sums = np.array(
        [(residue[:, L:] * residue[:, : PIECE - L]).sum(axis=1) * PIECE / (PIECE - L) for L in range(LAGS + 1)]
    )
    ripple = sliding_window_view(np.sqrt(sums[0] / PIECE), STRETCH, axis=0).min(axis=-1)
    total = sliding_window_view(sums, STRETCH, axis=1).sum(axis=-1)
    correlation = np.divide(total[1:], total[0], out=np.zeros_like(total[1:]), where=total[0] > 0.0)
    both = np.minimum(np.maximum.accumulate(-correlation, axis=0)[:-1], correlation[1:])
    periodicity = both.max(axis=0)
    return Stretches(
        ripple, periodicity, (both >= _SAME_PERIOD * periodicity).argmax(axis=0) + 2
    )  # the shortest lag, not a multiple of the period


@dataclass(frozen=True)
class Chatter:
    """Chatter of one joint.

    Attributes:
        ripple, share, periodicity, frequency: those of the worst stretch [N m], [1], [1], [Hz].
        begin, end: robot time of the first and the last chatter [s].
    """

    ripple: float
    share: float
    periodicity: float
    frequency: float
    begin: float
    end: float


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of the verdict; see the constants of this module."""

    share: float = CHATTER_SHARE
    periodicity: float = PERIODICITY
    wild_share: float = WILD_SHARE
    piece: int = PIECE
    stretch: int = STRETCH
    lags: int = LAGS


@dataclass(frozen=True)
class Stability:
    """Stability verdict of a run.

    Attributes:
        verdict: stable, unstable; None: the run is too short.
        loop: the same for the control loop alone, without the person.
        reasons: reasons why the run is unstable.
        joints: joints that chatter, the worst first.
        thresholds: thresholds of the verdict.
    """

    verdict: str | None
    loop: str | None
    reasons: tuple[str, ...]
    joints: dict[str, Chatter]
    thresholds: Thresholds

    def also(self, reasons: Sequence[str]) -> "Stability":
        """Return the verdict with further reasons why the run is unstable; `loop` remains."""
        verdict = UNSTABLE if reasons else self.verdict
        return replace(self, verdict=verdict, reasons=(*self.reasons, *reasons))


def chatter(log: ControlRecord, limits: Mapping[str, Mapping[str, float]]) -> dict[str, Chatter]:
    """Return the joints that chatter, the worst first.

    Args:
        log: control log.
        limits: limits by joint, as in run.yaml.
    """
    if log.cycles < PIECE * STRETCH:
        return {}
    ripples = stretches(log.torque)
    efforts = np.array([limits.get(name, {}).get("effort") or NO_LIMIT_EFFORT for name in log.joint_names])
    share = ripples.ripple / efforts
    bad = ((share >= CHATTER_SHARE) & (ripples.periodicity >= PERIODICITY)) | (share >= WILD_SHARE)
    result = {}
    for j in np.flatnonzero(bad.any(axis=0)):
        rows = np.flatnonzero(bad[:, j])
        worst = rows[share[rows, j].argmax()]
        begin, end = PIECE * rows[0], min(PIECE * (rows[-1] + STRETCH), log.cycles - 1)
        step = (log.time[PIECE * (worst + STRETCH) - 1] - log.time[PIECE * worst]) / (PIECE * STRETCH - 1)
        result[log.joint_names[j]] = Chatter(
            float(ripples.ripple[worst, j]),
            float(share[worst, j]),
            float(ripples.periodicity[worst, j]),
            float(1.0 / (ripples.period[worst, j] * step)),
            float(log.time[begin]),
            float(log.time[end]),
        )
    return dict(sorted(result.items(), key=lambda item: -item[1].share))


def judge(run: RunFile, log: ControlRecord, limits: Mapping[str, Mapping[str, float]]) -> Stability:
    """Return the stability verdict with its reasons, see INTERFACE.md.

    Args:
        run: contents of run.yaml.
        log: control log.
        limits: limits by joint, as in run.yaml.
    """
    joints = chatter(log, limits)
    reasons = [_text(name, values) for name, values in joints.items()]
    if ARM_ERROR in str(run.get("arm_error", "")):
        reasons.insert(0, f"the arm ended its motion: {ARM_ERROR}")
    kind, _, text = str(run.get("error", "")).partition(": ")
    if kind == DivergedError.__name__:
        reasons.insert(0, text)
    judged = bool(reasons) or log.cycles >= PIECE * STRETCH
    verdict = (UNSTABLE if reasons else STABLE) if judged else None
    return Stability(verdict, verdict, tuple(reasons), joints, Thresholds())


def _text(name: str, values: Chatter) -> str:
    how = f"at {values.frequency:.0f} Hz" if values.periodicity >= PERIODICITY else "without a period"
    when = f"from {values.begin:.2f} to {values.end:.2f} s"
    share = 100.0 * values.share
    return f"{name} chatters {how}, {values.ripple:.3g} N m RMS ({share:.3g} % of its effort limit), {when}"
