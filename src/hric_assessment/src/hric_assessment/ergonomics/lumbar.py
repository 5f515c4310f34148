"""Compression and shear of the lumbar spine at L5/S1, by a model with one equivalent extensor muscle.

    load = lumbar(moment, force, waist=0.146)    # LumbarLoad; NaN: not known
    level(np.nanmax(load.high))                  # judged by the worse end

    C = F_z + |M| / d,   M = M_waist + (z - h) F_x,   S = |F_x|

With the net moment M and the net force F of inverse dynamics, the lever arm d of the extensor, which pulls along the
trunk, and the heights z of the body's waist joint and h of L5/S1 above the hips, along the trunk. It is the static
model of Chaffin (J. Biomech. 2:429, 1969) without the pressure in the abdomen; F and M include the accelerations. Left
out: co-contraction, lateral bending and twisting, which would add to C, the mass between the two joints, and their
distance from front to back. A moment that bends the trunk backwards, which the abdominal muscles hold with a longer
lever arm, counts with d, too. The values are in config/tables/lumbar.yaml.
"""

from dataclasses import dataclass

import numpy as np

from hric_assessment.tables import UNITS, ValueTable, lumbar_table
from hric_core.geometry import FloatArray

SIDES = np.array([-1.0, 0.0, 1.0])
"""Lower end, middle and upper end of a range, in half-widths."""


@dataclass(frozen=True)
class LumbarLoad:
    """Load of the lumbar spine at L5/S1 at n instants; NaN: not known.

    Attributes:
        compression: force along the trunk, shape (n,) [N].
        low, high: ends of its interval, shape (n,) [N].
        shear: size of the force across the trunk, forwards or backwards, shape (n,) [N].
    """

    compression: FloatArray
    low: FloatArray
    high: FloatArray
    shear: FloatArray


def lumbar(moment: FloatArray, force: FloatArray, waist: float, table: ValueTable | None = None) -> LumbarLoad:
    """Return the load at L5/S1; its interval has the ranges of the lever arm and of the height of L5/S1.

    Args:
        moment: net moment of flexion that the pelvis exerts on the trunk at the waist joint, positive forwards, shape
            (n,) [N m].
        force: net force that the pelvis exerts on the trunk, in axes of the trunk (x forward, z up), shape (n, 3) [N].
        waist: height of the waist joint above the middle of the hip joint centres [m].
        table: values of the model; by default those of the package.
    """
    table = table or lumbar_table()
    keys = "lever_arm", "height"
    arms, heights = (UNITS["length"] * (table[key] + SIDES * table[f"{key}_range"]) for key in keys)
    nets = moment + (waist - heights)[:, None] * force[:, 0]
    sizes = np.abs(nets)
    smallest = np.where(nets[0] * nets[-1] < 0.0, 0.0, sizes.min(axis=0))
    ends = zip((smallest, sizes[1], sizes.max(axis=0)), arms[::-1], strict=True)
    low, middle, high = (force[:, 2] + size / arm for size, arm in ends)
    return LumbarLoad(middle, low, high, np.abs(force[:, 0]))


def level(compression: float, table: ValueTable | None = None) -> str:
    """Return the level of a compression [N] by the limits of NIOSH, in words."""
    table = table or lumbar_table()
    action, permissible = table["action_limit"], table["permissible"]
    if compression > permissible:
        return f"above the NIOSH maximum permissible limit of {1e-3 * permissible:.1f} kN"
    return f"{'below' if compression <= action else 'above'} the NIOSH action limit of {1e-3 * action:.1f} kN"
