"""Proposal distributions for importance sampling: mixtures of normal distributions fitted to weighted points.

The points are normal scores, so the variables are standard normal. A proposal is a mixture of a share of the standard
normal, which bounds the weights (a defensive mixture: Hesterberg, Technometrics 37:185, 1995), and components fitted to
the points near the limit, one for each failure region (Kurtz & Song, Struct. Saf. 42:35, 2013).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from hric_core.geometry import FloatArray

DEFENSIVE = 0.1
"""Share of each batch that is drawn from the distributions themselves [1]; no weight exceeds its inverse."""
NARROWEST, WIDEST = 0.35, 1.2
"""Bounds of a component's standard deviations along its axes [1]; narrower ones would miss tails of the failures."""
SHRINKAGE = 0.3
"""Minimum weight of the identity in a component's (shrunk) covariance [1]; it is larger if there are few points."""
COMPONENTS = 3
"""Maximum number of components, one per failure region (project default, unconfirmed)."""
STEPS = 30
"""Number of iterations of expectation maximisation per fit."""


def log_normal(z: FloatArray) -> FloatArray:
    """Return the log density of the standard normal at points of shape (m, n), shape (m,)."""
    density: FloatArray = -0.5 * np.sum(z * z, axis=1) - 0.5 * z.shape[1] * np.log(2.0 * np.pi)
    return density


@dataclass(frozen=True)
class Proposal:
    """Proposal distribution: a mixture of normal distributions (without the defensive share of standard normal).

    Attributes:
        shares: shares of the components, shape (k,).
        means: means of the components, shape (k, n).
        factors: Cholesky factors of the covariances, shape (k, n, n).
    """

    shares: FloatArray
    means: FloatArray
    factors: FloatArray

    def each(self, z: FloatArray) -> FloatArray:
        """Return log(share x density) of each component, shape (k, m), at points of shape (m, n)."""
        densities = []
        for share, mean, factor in zip(self.shares, self.means, self.factors, strict=True):
            scaled = np.linalg.solve(factor, (z - mean).T).T
            densities.append(np.log(share) + log_normal(scaled) - np.log(np.diag(factor)).sum())
        return np.array(densities)

    def log_weights(self, z: FloatArray, defensive: float) -> FloatArray:
        """Return the log likelihood ratios of points drawn from the mixture, shape (m,).

        Args:
            z: points, shape (m, n).
            defensive: share of the points that was drawn from the standard normal [1].
        """
        plain = log_normal(z)
        fitted = np.log1p(-defensive) + logsumexp(self.each(z), axis=0)
        weights: FloatArray = plain - np.logaddexp(np.log(defensive) + plain, fitted)
        return weights

    def draw(self, count: int, random: np.random.Generator) -> FloatArray:
        """Draw points from the components, shape (count, n)."""
        chosen = random.choice(len(self.shares), size=count, p=self.shares / self.shares.sum())
        scores = random.standard_normal((count, self.means.shape[1]))
        points: FloatArray = self.means[chosen] + np.einsum("mij,mj->mi", self.factors[chosen], scores)
        return points


def fit(z: FloatArray, weights: FloatArray) -> Proposal:
    """Fit a mixture to weighted points, with as many components as they support.

    The Bayesian information criterion, with the effective number of points, selects the number of components.

    Args:
        z: points, shape (m, n).
        weights: likelihood ratios, above 0, shape (m,).
    """
    weights = weights / weights.sum()
    size, n = 1.0 / float(np.sum(weights**2)), z.shape[1]
    best, lowest = None, np.inf
    for count in range(1, COMPONENTS + 1):
        if best is not None and len(z) < count * (n + 1):
            break
        made = _fitted(z, weights, count, size)
        likelihood = float(weights @ logsumexp(made.each(z), axis=0)) * size
        criterion = -2.0 * likelihood + np.log(max(size, 2.0)) * count * (n + 1)
        if criterion < lowest:
            best, lowest = made, criterion
    assert best is not None
    return best


def _fitted(z: FloatArray, weights: FloatArray, count: int, size: float) -> Proposal:
    """Fit `count` components by expectation maximisation, initialised with points far from each other."""
    n = z.shape[1]
    made = Proposal(np.full(count, 1.0 / count), _far_apart(z, weights, count), np.tile(np.eye(n), (count, 1, 1)))
    for _ in range(STEPS if count > 1 else 1):
        each = made.each(z)
        parts = np.exp(each - logsumexp(each, axis=0)) * weights
        shares = parts.sum(axis=1) + 1e-12
        means = parts @ z / shares[:, None]
        factors = [
            _factor(z - mean, part / share, size * share)
            for mean, part, share in zip(means, parts, shares, strict=True)
        ]
        made = Proposal(shares / shares.sum(), means, np.array(factors))
    return made


def _far_apart(z: FloatArray, weights: FloatArray, count: int) -> FloatArray:
    """Return initial means: the point of largest weight, then those of largest weight x squared distance to these."""
    chosen = [z[np.argmax(weights)]]
    while len(chosen) < count:
        nearest = np.min([np.sum((z - point) ** 2, axis=1) for point in chosen], axis=0)
        chosen.append(z[np.argmax(nearest * weights)])
    return np.array(chosen)


def _factor(deviations: FloatArray, weights: FloatArray, size: float) -> FloatArray:
    """Return the Cholesky factor of a component's covariance, shrunk towards the identity, with bounded eigenvalues."""
    n = deviations.shape[1]
    towards = min(1.0, max(SHRINKAGE, (n + 1) / max(size, 1e-9)))
    values, axes = np.linalg.eigh((1.0 - towards) * (deviations.T * weights) @ deviations + towards * np.eye(n))
    bounded: FloatArray = (axes * np.clip(values, NARROWEST**2, WIDEST**2)) @ axes.T
    return np.linalg.cholesky(0.5 * (bounded + bounded.T)).astype(float)
