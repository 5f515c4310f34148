"""Surfaces of triangles that are smoothed and split where a value changes its sign."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix, identity, vstack

from hric_core.geometry import FloatArray

Indices = npt.NDArray[np.int64]


class Split(NamedTuple):
    """Surface of n vertices that is split into two parts, each with r vertices of its own along the edge.

    Attributes:
        inside, outside: triangles of both parts, shape (m, 3); the edge has the vertices n to n + r of the part inside,
            n + r to n + 2 r of the other.
        rim: line segments of the edge, begin and end as indices 0 to r - 1, oriented as in the triangles inside, shape
            (p, 2).
        mixing: shares of the old vertices in the new ones, shape (n + 2 r, n); the first n are the old ones.
        near: old vertex of the same part next to each new one, shape (n + 2 r,).
    """

    inside: Indices
    outside: Indices
    rim: Indices
    mixing: csr_matrix
    near: Indices


def smoothed(triangles: npt.NDArray[np.integer], values: FloatArray, times: int) -> FloatArray:
    """Return values of n vertices, shape (n, k), each half replaced by the mean of its neighbours, several times."""
    i, j = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)]).T
    n = len(values)
    near = csr_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(n, n))
    count = np.maximum(np.asarray(near.sum(axis=1)), 1.0)
    for _ in range(times):
        values = 0.5 * values + 0.5 * (near @ values) / count
    return values


def split(triangles: npt.NDArray[np.integer], level: FloatArray) -> Split:
    """Split a surface where a value is zero.

    Args:
        triangles: indices of vertices, shape (m, 3).
        level: value at each vertex, shape (n,); above zero is inside.
    """
    n, inside = len(level), level > 0.0
    count = inside[triangles].sum(axis=1)
    mixed = (count == 1) | (count == 2)
    one = count[mixed] == 1  # the odd corner, which comes first, is inside
    odd = np.argmax(inside[triangles[mixed]] == one[:, None], axis=1)
    a, b, c = np.take_along_axis(triangles[mixed], (odd[:, None] + np.arange(3)) % 3, axis=1).T
    edges, index = np.unique(np.sort([np.r_[a, a], np.r_[b, c]], axis=0), axis=1, return_inverse=True)
    (p, q), r = index.reshape(2, -1), edges.shape[1]
    tip, rest = n + np.where(one, 0, r), n + np.where(one, r, 0)  # first vertex of the edge in each part
    corner = np.array([a, tip + p, tip + q]).T
    quad = np.array([[rest + p, b, c], [rest + p, c, rest + q]]).swapaxes(1, 2)
    share = level[edges[0]] / (level[edges[0]] - level[edges[1]])
    at = np.r_[np.arange(r), np.arange(r)]
    on_edges = csr_matrix((np.r_[1.0 - share, share], (at, edges.ravel())), shape=(r, n))
    first = inside[edges[0]]
    return Split(
        np.concatenate((triangles[count == 3], corner[one], *quad[:, ~one])),
        np.concatenate((triangles[count == 0], corner[~one], *quad[:, one])),
        np.array([np.where(one, p, q), np.where(one, q, p)]).T,
        vstack((identity(n), on_edges, on_edges), format="csr"),
        np.concatenate((np.arange(n), np.where(first, *edges), np.where(first, *edges[::-1]))),
    )
