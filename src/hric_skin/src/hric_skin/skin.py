"""Skin of one subject: vertices in a bind pose, moved by the links of the body."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from hric_core.errors import check_known
from hric_core.geometry import FloatArray
from hric_skin.regions import REGION_KEYS, keys_of, shade
from hric_skin.surface import split
from hric_skin.template import REGIONS, ZONES

CLOTHES = {
    "skin": (0.80, 0.62, 0.52),
    "hair": (0.23, 0.18, 0.15),
    "shirt": (0.36, 0.48, 0.60),
    "trousers": (0.25, 0.29, 0.36),
    "shoes": (0.17, 0.16, 0.16),
}
"""Colours of plain work clothes: red, green, blue."""
ARM_SHARE = 0.3
"""Smallest weight of an arm's links at a vertex that belongs to an arm without trunk [1]."""


@dataclass(frozen=True)
class Skin:
    """Surface of n vertices and m triangles, for linear blend skinning with k links.

    v = sum over links of weight * T_link * inverse(T_link in the bind pose) * v_bind

    Attributes:
        links: names of the links that move it.
        vertices: vertices in the bind pose, in axes of `human_base`, shape (n, 3) [m].
        triangles: indices of vertices, counter-clockwise from outside, shape (m, 3).
        weights: share of each link in the motion of a vertex, each row adds up to 1, shape (n, k).
        T_base_link: poses of the links in the bind pose, shape (k, 4, 4).
        zones: index into `ZONES` of each vertex, shape (n,).
        regions: index into `REGIONS` of each vertex, shape (n,).
    """

    links: tuple[str, ...]
    vertices: FloatArray
    triangles: npt.NDArray[np.int32]
    weights: FloatArray
    T_base_link: FloatArray
    zones: npt.NDArray[np.uint8]
    regions: npt.NDArray[np.uint8]

    def posed(self, transforms: Mapping[str, FloatArray]) -> FloatArray:
        """Return the vertices at given poses of the links, in the frame of these poses, shape (n, 3) [m].

        Args:
            transforms: pose of each of `links`, shape (4, 4).
        """
        T_frame_link = np.array([transforms[name] for name in self.links])
        T_frame_base = (T_frame_link @ np.linalg.inv(self.T_base_link))[:, :3]
        blended = (self._few_weights @ T_frame_base.reshape(-1, 12)).reshape(-1, 3, 4)
        moved: FloatArray = np.einsum("nij,nj->ni", blended[:, :, :3], self.vertices) + blended[:, :, 3]
        return moved

    @cached_property
    def _few_weights(self) -> csr_matrix:
        """Weights as a sparse matrix: with a dense one, the product would use several threads and take longer."""
        return csr_matrix(self.weights)

    @property
    def influences(self) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Indices of the four links of the largest weights of each vertex, and these weights, each of shape (n, 4)."""
        links = np.argsort(-self.weights, axis=1, kind="stable")[:, :4]
        return links, np.take_along_axis(self.weights, links, axis=1)

    @property
    def colours(self) -> FloatArray:
        """Colour of each vertex in work clothes: red, green, blue, shape (n, 3)."""
        return np.array([CLOTHES[name] for name in ZONES])[self.zones]

    @property
    def region_keys(self) -> npt.NDArray[np.int64]:
        """Index into `REGION_KEYS` of each vertex, shape (n,)."""
        left = np.array([name.startswith("l_") for name in self.links])
        right = np.array([name.startswith("r_") for name in self.links])
        return keys_of(self.regions, self.weights @ left > self.weights @ right)

    def region(self, name: str) -> npt.NDArray[np.bool_]:
        """Return True for each vertex of a body region of ISO/TS 15066, shape (n,)."""
        own: npt.NDArray[np.bool_] = self.regions == REGIONS.index(name)
        return own

    def region_colours(self, shares: Mapping[str, float | None]) -> FloatArray:
        """Return the colour of each vertex: red, green, blue, shape (n, 3).

        Args:
            shares: shares of the limit [1] by region (see `REGION_KEYS`); None or NaN: not known, drawn grey. All other
                regions keep the colours of the clothes.

        Raises:
            UnknownNameError: there is no such region.
        """
        check_known("region", shares, REGION_KEYS, "the skin")
        colours, keys = self.colours, self.region_keys
        for name, share in shares.items():
            colours[keys == REGION_KEYS.index(name)] = shade(share)
        return colours

    def volume(self, vertices: FloatArray) -> float:
        """Return the volume that the surface encloses at given vertices, shape (n, 3) [m^3]."""
        a, b, c = (vertices[self.triangles[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0

    def of_links(self, present: Collection[str]) -> "Skin":
        """Return the part of the skin that the given links move, closed where it is cut off from the others.

        Args:
            present: names of links; those that do not move the skin are ignored.
        """
        kept = np.array([name in present for name in self.links])
        if kept.all():
            return self
        level, weights = self._above_cut(kept)
        mixing, likeness, triangles = _cut(self.triangles, level)
        used, flat = np.unique(triangles, return_inverse=True)
        mixing, likeness = mixing[used], likeness[used]
        return replace(
            self,
            links=tuple(name for name in self.links if name in present),
            vertices=mixing @ self.vertices,
            triangles=flat.reshape(-1, 3).astype(np.int32),
            weights=mixing @ weights[:, kept],
            T_base_link=self.T_base_link[kept],
            zones=self.zones[likeness],
            regions=self.regions[likeness],
        )

    def _above_cut(self, kept: npt.NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """Return where a part of the skin ends, and its weights.

        The cut is flat: level through the hip joints, or upright through the shoulder of an arm alone.

        Args:
            kept: True for links of the part, shape (k,).

        Returns:
            Distance of each vertex from the cut, below zero outside of the part, shape (n,) [m]; and weights that
            sum up to 1 in these links, shape (n, k).
        """
        of_part, weights = self.weights[:, kept].sum(axis=1), self.weights * kept
        if kept[self.links.index("waist")]:
            arms = self.weights[:, [name[2:].startswith(("sh", "el", "wr")) for name in self.links]].sum(axis=1)
            level = np.where(arms > 0.0, 1.0, self.vertices[:, 2])  # the origin is between the hip joints
            weights[:, self.links.index("waist")] += 1.0 - of_part
            return level, weights
        level = of_part - ARM_SHARE
        for side, sign in (("r", -1.0), ("l", 1.0)):
            root, own = self.links.index(f"{side}_shoulder_abd"), sign * self.vertices[:, 1] > 0.0
            level[own] = np.minimum(level, sign * (self.vertices[:, 1] - self.T_base_link[root, 1, 3]))[own]
            weights[own, root] += 1.0 - of_part[own]
        return level, weights


def _cut(
    triangles: npt.NDArray[np.int32], level: FloatArray
) -> tuple[csr_matrix, npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Cut a closed surface of n vertices where a level is zero, and close it there by a fan around each loop.

    Args:
        triangles: indices of vertices, shape (m, 3).
        level: value at each vertex, shape (n,); the part above zero is kept.

    Returns:
        Shares of the old vertices in each new one, shape (k, n); the old vertex whose zone and region each new one has,
        shape (k,); the new triangles. The first n vertices are the old ones.
    """
    parts, n = split(triangles, level), len(level)
    r = (parts.mixing.shape[0] - n) // 2
    begin, end = parts.rim.T
    loops, of_point = connected_components(csr_matrix((np.ones(len(begin)), (begin, end)), shape=(r, r)))
    mean = csr_matrix((1.0 / np.bincount(of_point)[of_point], (of_point, np.arange(r))), shape=(loops, r))
    # The fans have the vertices of the other part along the edge, so that it is drawn sharp.
    fans = np.array([n + r + end, n + r + begin, n + 2 * r + of_point[begin]]).T
    own = parts.near[n : n + r]
    mixing = vstack((parts.mixing, mean @ parts.mixing[n : n + r]), format="csr")
    of_loop = own[[np.argmax(of_point == loop) for loop in range(loops)]]
    return mixing, np.concatenate((np.arange(n), own, own, of_loop)), np.concatenate((parts.inside, fans))
