"""Skin of one subject: vertices in a bind pose, moved by the links of the body."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from hric_core.geometry import FloatArray
from hric_skin.template import REGIONS, ZONES

CLOTHES = {
    "skin": (0.80, 0.62, 0.52),
    "hair": (0.23, 0.18, 0.15),
    "shirt": (0.36, 0.48, 0.60),
    "trousers": (0.25, 0.29, 0.36),
    "shoes": (0.17, 0.16, 0.16),
}
"""Colours of plain work clothes: red, green, blue."""


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
        blended = (self.weights @ T_frame_base.reshape(-1, 12)).reshape(-1, 3, 4)
        moved: FloatArray = np.einsum("nij,nj->ni", blended[:, :, :3], self.vertices) + blended[:, :, 3]
        return moved

    @property
    def influences(self) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Indices of the four links of the largest weights of each vertex, and these weights, each of shape (n, 4)."""
        links = np.argsort(-self.weights, axis=1, kind="stable")[:, :4]
        return links, np.take_along_axis(self.weights, links, axis=1)

    @property
    def colours(self) -> FloatArray:
        """Colour of each vertex in work clothes: red, green, blue, shape (n, 3)."""
        return np.array([CLOTHES[name] for name in ZONES])[self.zones]

    def region(self, name: str) -> npt.NDArray[np.bool_]:
        """Return True for each vertex of a body region of ISO/TS 15066, shape (n,)."""
        own: npt.NDArray[np.bool_] = self.regions == REGIONS.index(name)
        return own

    def volume(self, vertices: FloatArray) -> float:
        """Return the volume that the surface encloses at given vertices, shape (n, 3) [m^3]."""
        a, b, c = (vertices[self.triangles[:, corner]] for corner in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0

    def of_links(self, present: Collection[str]) -> "Skin":
        """Return the part of the skin that some links move; it is open where the others began.

        Args:
            present: names of links; those that do not move the skin are ignored.
        """
        kept = np.array([name in present for name in self.links])
        share = self.weights[:, kept].sum(axis=1)
        triangles = self.triangles[np.all(share[self.triangles] > 0.5, axis=1)]
        used, flat = np.unique(triangles, return_inverse=True)
        weights = self.weights[used][:, kept] / share[used, None]
        links = tuple(name for name in self.links if name in present)
        return replace(
            self,
            links=links,
            vertices=self.vertices[used],
            triangles=flat.reshape(-1, 3).astype(np.int32),
            weights=weights,
            T_base_link=self.T_base_link[kept],
            zones=self.zones[used],
            regions=self.regions[used],
        )
