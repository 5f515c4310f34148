"""Body regions of the skin by side, and the colours of contact loads on them."""

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from hric_core.geometry import FloatArray
from hric_human.body.segments import SIDES
from hric_skin.template import REGIONS

PAIRED = (
    *("upper arm, elbow", "lower arm, wrist", "hand, fingers"),
    *("thigh, knee", "lower leg", "foot, toes, ankle"),
)
"""Regions that the body has on two sides."""
SCALE = ((0.0, (246, 234, 196)), (0.8, (224, 138, 44)), (1.0, (179, 38, 30)))
"""Colour scale: (share of the limit, RGB colour), interpolated linearly; shares above 1 have the last colour."""
NOT_KNOWN = (150, 152, 158)
"""RGB colour of a region whose share of the limit is not known."""


def region_key(region: str, side: str) -> str:
    """Return the name of a region with its side, "right lower arm, wrist"; without in the middle of the body."""
    return f"{side} {region}" if region in PAIRED else region


REGION_KEYS = tuple(region_key(region, side) for side in SIDES for region in REGIONS if region in PAIRED) + tuple(
    region for region in REGIONS if region not in PAIRED
)
"""Names of all regions; a region that the body has on two sides has one for each side."""


def keys_of(regions: npt.NDArray[np.uint8], left: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Return the index into `REGION_KEYS` of each vertex, shape (n,).

    Args:
        regions: index into `REGIONS` of each vertex, shape (n,).
        left: True for vertices on the left side, shape (n,); without effect in the middle of the body.
    """
    of_side = [[REGION_KEYS.index(region_key(region, side)) for region in REGIONS] for side in SIDES]
    keys: npt.NDArray[np.int64] = np.array(of_side)[left.astype(int), regions]
    return keys


def shade(share: float | None) -> FloatArray:
    """Return the colour (red, green, blue) of a share of the limit [1] in `SCALE`; None or NaN: share not known."""
    if share is None or math.isnan(share):
        return np.array(NOT_KNOWN) / 255.0
    for (low, a), (high, b) in pairwise(SCALE):
        if share <= high:
            return (np.array(a) + max(share - low, 0.0) / (high - low) * np.subtract(b, a)) / 255.0
    return np.array(SCALE[-1][1]) / 255.0
