"""What the converter asks of those who turn mesh files into files that OpenSim reads."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshRequest:
    """A mesh file of the description.

    Attributes:
        link: that shows it, for errors.
        address: as the description has it: package://, file:// or a path.
        scale: factors along x, y, z, applied to the vertices.
        file: name that the model has for the result in Geometry/, without folder or ending; the same for the same address and scale.
    """

    link: str
    address: str
    scale: tuple[float, float, float]
    file: str
