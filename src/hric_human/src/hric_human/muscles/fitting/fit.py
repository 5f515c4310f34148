"""Least-squares fit of polynomials to samples of muscle lengths, moment arms and forces across joint centres."""

import numpy as np

from hric_core.geometry import FloatArray
from hric_human.muscles.anatomy import FitError, Muscle, MusclePath
from hric_human.muscles.fitting.sample import MuscleSamples
from hric_human.muscles.polynomial import Polynomial, monomials, slopes

ORDERS, FEW_JOINTS = (5, 4), 3
"""Order of the length polynomial of a muscle on up to FEW_JOINTS joints, and on more.

The polynomials of a muscle's force across a joint centre have an order one lower.
"""
NO_ARM, NO_PULL = 1e-4, 1e-6
"""Moment arm [m], and force across a joint per muscle force [1], up to which a muscle does not count as acting."""
LENGTH_WEIGHT = 0.3
"""Weight of an error of the length [m] relative to an error of a moment arm [m/rad]; project default.

No polynomial satisfies both if the girdle moves in the samples of the lengths and is fixed in those of moment arms.
"""


def fit_muscle(
    samples: MuscleSamples,
    k: int,
    joints: tuple[str, ...],
    name: str,
    force: float,
    optimal: float,
    slack: float,
    path: MusclePath,
) -> Muscle:
    """Fit muscle k of the samples.

    Args:
        samples: samples of the model.
        k: index of the muscle.
        joints: joints of the samples.
        name: name of the muscle, without a side.
        force: maximum isometric force [N].
        optimal: optimal fibre length [m].
        slack: tendon slack length [m].
        path: points through which the muscle is drawn.
    """
    length = _length(samples, k, joints)
    crossed = [centre for centre, pull in samples.pulls.items() if np.abs(pull[:, k]).max() > NO_PULL]
    pulls = {centre: _pull(samples, k, centre, joints, length.joints) for centre in crossed}
    return Muscle(name, rounded(force), rounded(optimal), rounded(slack), length, pulls, path)


def arm_errors(samples: MuscleSamples, k: int, joints: tuple[str, ...], muscle: Muscle) -> FloatArray:
    """Return the errors of muscle k's fitted moment arms about the joints that it acts on, shape (N, joints) [m]."""
    acts = [joints.index(name) for name in muscle.length.joints]
    return np.asarray(-muscle.length.gradients(samples.q[:, acts]) - samples.arms[:, k, acts])


def fit_error(samples: MuscleSamples, k: int, joints: tuple[str, ...], muscle: Muscle) -> FitError:
    """Return the errors of the fitted muscle k at samples that were not used in its fit."""
    q = samples.q[:, [joints.index(name) for name in muscle.length.joints]]
    arms, worst = arm_errors(samples, k, joints, muscle), {}
    for centre, parts in muscle.pulls.items():
        missed = np.stack([part.values(q) for part in parts], axis=1) - samples.pulls[centre][:, k]
        worst[centre] = rounded(float(np.linalg.norm(missed, axis=1).max()))
    length = _rms(muscle.length.values(q) - samples.length[:, k])
    return FitError(rounded(length), rounded(_rms(arms)), rounded(float(np.abs(arms).max(initial=0.0))), worst)


def _length(samples: MuscleSamples, k: int, joints: tuple[str, ...]) -> Polynomial:
    """Fit the muscle-tendon length [m] of muscle k; the moment arms are its negative gradient."""
    acts = np.flatnonzero(np.abs(samples.arms[:, k]).max(axis=0) > NO_ARM)
    order = ORDERS[len(acts) > FEW_JOINTS]
    q = samples.q[:, acts]
    rows = [LENGTH_WEIGHT * monomials(q, order), *slopes(q, order)]
    values = [LENGTH_WEIGHT * samples.length[:, k], *(-samples.arms[:, k, acts].T)]
    solution = _solve(np.concatenate(rows), np.concatenate(values))
    return Polynomial(tuple(joints[i] for i in acts), order, solution)


def _pull(
    samples: MuscleSamples, k: int, centre: str, joints: tuple[str, ...], of: tuple[str, ...]
) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Fit the force of muscle k across a joint centre, per muscle force: polynomials for x, y, z in angles of `of`."""
    order = ORDERS[len(of) > FEW_JOINTS] - 1
    terms = monomials(samples.q[:, [joints.index(name) for name in of]], order)
    x, y, z = (Polynomial(of, order, _solve(terms, part)) for part in samples.pulls[centre][:, k].T)
    return x, y, z


def rounded(value: float) -> float:
    """Round to 12 significant digits, so that a repeated fit writes the same file."""
    return float(f"{value:.11e}")


def _solve(terms: FloatArray, values: FloatArray) -> tuple[float, ...]:
    """Return the least-squares coefficients."""
    scale = np.linalg.norm(terms, axis=0)
    solution, *_ = np.linalg.lstsq(terms / scale, values)
    return tuple(map(rounded, solution / scale))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
