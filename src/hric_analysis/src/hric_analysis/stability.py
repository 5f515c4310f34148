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
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from hric_bags.reader import ControlRecord
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


def chatter(log: ControlRecord, limits: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Return the joints that chatter, the worst first.

    Each has ripple [N m], share [1], periodicity [1] and frequency [Hz] of its worst stretch, and begin and end of all
    chatter [s].

    Args:
        log: control log.
        limits: limits by joint, as in run.yaml.
    """
    if log.cycles < PIECE * STRETCH:
        return {}
    found = stretches(log.torque)
    efforts = np.array([limits.get(name, {}).get("effort") or NO_LIMIT_EFFORT for name in log.joint_names])
    share = found.ripple / efforts
    bad = ((share >= CHATTER_SHARE) & (found.periodicity >= PERIODICITY)) | (share >= WILD_SHARE)
    result = {}
    for j in np.flatnonzero(bad.any(axis=0)):
        bad_ones = np.flatnonzero(bad[:, j])
        worst = bad_ones[share[bad_ones, j].argmax()]
        begin, end = PIECE * bad_ones[0], min(PIECE * (bad_ones[-1] + STRETCH), log.cycles - 1)
        step = (log.time[PIECE * (worst + STRETCH) - 1] - log.time[PIECE * worst]) / (PIECE * STRETCH - 1)
        result[log.joint_names[j]] = {
            "ripple": float(found.ripple[worst, j]),
            "share": float(share[worst, j]),
            "periodicity": float(found.periodicity[worst, j]),
            "frequency": float(1.0 / (found.period[worst, j] * step)),
            "begin": float(log.time[begin]),
            "end": float(log.time[end]),
        }
    return dict(sorted(result.items(), key=lambda item: -item[1]["share"]))


def judge(run: Mapping[str, Any], log: ControlRecord, limits: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Return the stability verdict with its reasons for metrics.json, see INTERFACE.md.

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
    thresholds = {
        "share": CHATTER_SHARE,
        "periodicity": PERIODICITY,
        "wild_share": WILD_SHARE,
        "piece": PIECE,
        "stretch": STRETCH,
        "lags": LAGS,
    }
    return {"verdict": verdict, "loop": verdict, "reasons": reasons, "joints": joints, "thresholds": thresholds}


def also(found: Mapping[str, Any], reasons: Sequence[str]) -> dict[str, Any]:
    """Return the result of `judge` with further reasons why the run is unstable; its verdict remains as `loop`."""
    verdict = UNSTABLE if reasons else found["verdict"]
    return {**found, "verdict": verdict, "reasons": [*found["reasons"], *reasons]}


def _text(name: str, values: Mapping[str, float]) -> str:
    share, how = (
        100.0 * values["share"],
        f"at {values['frequency']:.0f} Hz" if values["periodicity"] >= PERIODICITY else "without a period",
    )
    when = f"from {values['begin']:.2f} to {values['end']:.2f} s"
    return f"{name} chatters {how}, {values['ripple']:.3g} N m RMS ({share:.3g} % of its effort limit), {when}"
