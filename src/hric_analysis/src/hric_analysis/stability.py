"""Stability verdict of the control loop of a run.

A run is unstable if the simulation diverged, if the arm stopped with `instability_detected`, if human and robot do not
come to rest after the person's motion (`human_values.instability_reasons`), or if a joint chatters (oscillates at a
high frequency), as defined here.

tau_k is the torque of a joint in cycle k: the requested torque if it is effort-controlled, else the measured torque.
The log is cut into pieces of PIECE cycles. r_k is tau_k minus its least-squares parabola over the piece; this removes
motion and gravity and leaves oscillations with periods up to about half a piece. For each stretch of STRETCH
consecutive pieces
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
"""Number of cycles of a piece of the log; at 1 kHz, oscillations above about 60 Hz remain in it. Default chosen by this
project, unconfirmed."""
STRETCH = 10
"""Minimum duration of chatter, as number of pieces: 0.25 s at 1 kHz, longer than the oscillation after a contact.
Default chosen by this project, unconfirmed."""
LAGS = 12
"""Longest period of chatter that is detected [cycles]. Default chosen by this project, unconfirmed."""
CHATTER_SHARE = 0.02
"""Minimum RMS of periodic torque ripple, as share of the effort limit, that counts as chatter [1]. Default chosen by
this project, unconfirmed. For comparison: a Panda wrist torque that changes its sign each cycle at the rate limit of
1000 N m/s has 0.042, stable loops at most 0.001, a loop that presses with friction on a stiff block 0.006."""
PERIODICITY = 0.5
"""Minimum periodicity of ripple to count as periodic [1]. Default chosen by this project, unconfirmed: chatter has 0.5
to 1, noise less than 0.3."""
WILD_SHARE = 0.1
"""Minimum RMS of torque ripple without a period, as share of the effort limit, that counts as chatter [1]. Default
chosen by this project, unconfirmed: the noise of a Panda's measured speed (6e-3 rad/s) with a gain of 100 N m s/rad
gives 0.05."""
NO_LIMIT_EFFORT = 100.0
"""Effort limit assumed for a joint without a known limit [N m or N]. Default chosen by this project, unconfirmed."""
_SAME_PERIOD = 0.9
"""Share of the largest periodicity above which the shortest such lag is taken as the period [1]."""
STABLE, UNSTABLE = "stable", "unstable"
ARM_ERROR = "instability_detected"
"""Name in libfranka of the error by which the arm reports an instability."""


@dataclass(frozen=True)
class Stretches:
    """Torque ripple and periodicity in n stretches of the log, for j joints.

    Attributes:
        ripple: RMS ripple, shape (n, j) [N m].
        periodicity: periodicity, shape (n, j) [1].
        period: lag of the periodicity, shape (n, j) [cycles].
    """

    ripple: FloatArray
    periodicity: FloatArray
    period: npt.NDArray[np.intp]


def stretches(torque: FloatArray) -> Stretches:
    """Return torque ripple and periodicity in each stretch of a log.

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
    )  # the shortest lag is the period, longer ones are multiples of it


@dataclass(frozen=True)
class Chatter:
    """Chatter (high-frequency oscillation) of one joint.

    Attributes:
        ripple, share, periodicity, frequency: RMS torque ripple [N m], its share of the effort limit [1], periodicity
            [1] and frequency [Hz] in the worst stretch.
        begin, end: robot time at which the chatter begins and ends [s].
    """

    ripple: float
    share: float
    periodicity: float
    frequency: float
    begin: float
    end: float


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of the stability verdict; see the constants of this module."""

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
        verdict: STABLE or UNSTABLE; None: the run is too short.
        loop: verdict for the control loop alone, without the person.
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
        """Return a copy with further reasons for instability; the verdict `loop` on the control loop is unchanged."""
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
    """Return the stability verdict on a run, with its reasons.

    Args:
        run: contents of run.yaml.
        log: control log.
        limits: limits by joint, as in run.yaml.
    """
    joints = chatter(log, limits)
    reasons = [_text(name, values) for name, values in joints.items()]
    if ARM_ERROR in str(run.get("arm_error", "")):
        reasons.insert(0, f"the arm stopped with the error {ARM_ERROR}")
    kind, _, text = str(run.get("error", "")).partition(": ")
    if kind == DivergedError.__name__:
        reasons.insert(0, text)
    judged = bool(reasons) or log.cycles >= PIECE * STRETCH
    verdict = (UNSTABLE if reasons else STABLE) if judged else None
    return Stability(verdict, verdict, tuple(reasons), joints, Thresholds())


def _text(name: str, values: Chatter) -> str:
    how = f"at {values.frequency:.0f} Hz" if values.periodicity >= PERIODICITY else "without a fixed period"
    when = f"from {values.begin:.2f} to {values.end:.2f} s"
    share = 100.0 * values.share
    return f"{name} chatters {how}, {values.ripple:.3g} N m RMS ({share:.3g} % of its effort limit), {when}"
