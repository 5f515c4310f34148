"""Where an arrow points at a link of a body: contacts by region have neither point nor direction."""

from typing import NamedTuple

from hric_control.geometry import FloatArray
from hric_control.urdf import read


class Tip(NamedTuple):
    """Of an arrow at a link, before the middle of its capsule.

    Attributes:
        point: on the surface, in axes of the link, shape (3,) [m].
        outward: unit vector, shape (3,).
    """

    point: FloatArray
    outward: FloatArray


def tips(description: str) -> dict[str, Tip]:
    """By link with a capsule, of the URDF of a body. Raises DescriptionError."""
    found = {}
    for link in read(description).links.values():
        for shape in link.visuals:
            if shape.kind == "cylinder":
                middle, outward = shape.T_link_shape[:3, 3], shape.T_link_shape[:3, 0]
                found[link.name] = Tip(middle + shape.size[0] * outward, outward)
    return found
