"""Skin of the person for pictures: a mesh that follows the joints of the body.

    skin = fitted(body)
    points = skin.posed(transforms)  # of each link in `skin.links`, in any frame

It is for looking at: masses, joint centres, distances and contacts are those of `hric_human` and its capsules.
"""

from hric_skin.fit import fitted
from hric_skin.regions import PAIRED, REGION_KEYS, SCALE, region_key, shade
from hric_skin.skin import Skin

__all__ = ["PAIRED", "REGION_KEYS", "SCALE", "Skin", "fitted", "region_key", "shade"]
