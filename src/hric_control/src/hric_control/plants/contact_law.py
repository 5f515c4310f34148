"""Laws of the normal force of penalty contact: spring, Hunt-Crossley, and viscoelastic layers in series.

With penetration x of the two surfaces, a contact force F that never pulls is

    F = k x + c x'                                       spring and damper; with c = 0 the law of ISO/TS 15066
    F = k x^n (1 + d x')                                 Hunt and Crossley (1975), dissipation d
    F = g_i (x_i - z_i) + k_i z_i,   sum of x_i = x      layers in series, each a standard linear solid

A layer i has the stiffness k_i when it is held and g_i = k_i + r_i at once. Its relaxing spring r_i pulls through a
damper, whose deflection z_i follows with the relaxation time T_i, z_i' = (x_i - z_i) / T_i. With F common to all
layers, x_i = (F + r_i z_i) / g_i, hence F = (x - sum of r_i z_i / g_i) / sum of 1 / g_i, and z_i' = (F - k_i z_i) /
(g_i T_i). A plain spring is a layer with r = 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

Strains = tuple[float, ...]
"""Deflection of the damper in each layer [m]; empty for laws without layers."""


class Layer(NamedTuple):
    """Viscoelastic layer: a spring, and in parallel a second spring that relaxes.

    Attributes:
        stiffness: stiffness of the layer when it has relaxed [N/m].
        relaxing: stiffness of the relaxing spring [N/m]; 0: the layer is elastic.
        relaxation_time: time in which the force of the relaxing spring decays by the factor e [s].
    """

    stiffness: float
    relaxing: float = 0.0
    relaxation_time: float = 1.0


@dataclass(frozen=True, slots=True)
class ContactLaw:
    """Normal force of a pair of surfaces.

    Attributes:
        stiffness: stiffness k [N/m^exponent]; with layers, that of all relaxed layers in series [N/m].
        damping: damping c [N s/m].
        exponent: exponent n [1].
        dissipation: dissipation d of Hunt and Crossley [s/m].
        layers: viscoelastic layers; empty: none.
    """

    stiffness: float
    damping: float = 0.0
    exponent: float = 1.0
    dissipation: float = 0.0
    layers: tuple[Layer, ...] = ()

    @property
    def elastic(self) -> bool:
        """True for the linear spring of ISO/TS 15066, which loses no energy."""
        return not (self.damping or self.dissipation or self.layers) and self.exponent == 1.0

    def load(self, x: float, v: float, strains: Strains = ()) -> float:
        """Return the force [N] at penetration x [m] and its rate v [m/s], at least 0, as a contact never pulls."""
        if x <= 0.0:
            return 0.0
        if self.layers:
            pairs = zip(self.layers, strains, strict=True)
            rest = sum(layer.relaxing * z / (layer.stiffness + layer.relaxing) for layer, z in pairs)
            load = (x - rest) * self.tangent(x)
        elif self.exponent == 1.0:
            load = self.stiffness * x * (1.0 + self.dissipation * v) + self.damping * v
        else:
            load = self.stiffness * x**self.exponent * (1.0 + self.dissipation * v) + self.damping * v
        return load if load > 0.0 else 0.0

    def rates(self, strains: Strains, load: float) -> Strains:
        """Return the rates of the dampers' deflections [m/s], by layer, under a force `load` [N]."""
        return tuple(
            (load - layer.stiffness * z) / ((layer.stiffness + layer.relaxing) * layer.relaxation_time)
            for layer, z in zip(self.layers, strains, strict=True)
        )

    def tangent(self, x: float) -> float:
        """Return the stiffness [N/m] against a sudden change of the penetration x [m]."""
        if self.layers:
            return 1.0 / sum(1.0 / (layer.stiffness + layer.relaxing) for layer in self.layers)
        return self.stiffness if self.exponent == 1.0 else self.exponent * self.stiffness * x ** (self.exponent - 1.0)


def in_series(laws: Sequence[ContactLaw]) -> ContactLaw:
    """Return the combined law of two surfaces in contact, or of one on a rigid surface.

    Springs of exponent n have together the stiffness (sum of k_i^(-1/n))^-n. The larger damping counts; the dissipation
    of each surface counts by its share of the penetration, as in Simbody's Hunt-Crossley force. As soon as one surface
    is viscoelastic, all become layers, without damping; a spring is then a layer that does not relax.
    """
    if any(law.layers for law in laws):
        layers = tuple(layer for law in laws for layer in law.layers or (Layer(law.stiffness),))
        return ContactLaw(1.0 / sum(1.0 / layer.stiffness for layer in layers), layers=layers)
    exponent = max(law.exponent for law in laws)
    if exponent == 1.0:
        stiffness = 1.0 / sum(1.0 / law.stiffness for law in laws)
    else:
        stiffness = sum(law.stiffness ** (-1.0 / exponent) for law in laws) ** -exponent
    dissipation = sum(law.dissipation * (stiffness / law.stiffness) ** (1.0 / exponent) for law in laws)
    return ContactLaw(stiffness, max(law.damping for law in laws), exponent, dissipation)
