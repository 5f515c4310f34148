"""Gains of the PD controller: from the YAML, and live through dynamic_reconfigure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hric_control.errors import ParameterError
from hric_control.node import LiveParameter, Node
from hric_controllers.parameters import is_number, per_joint

LARGEST = 1e5
"""Upper end of the range that dynamic_reconfigure shows for a gain; far above anything an arm can use."""


@dataclass(frozen=True)
class PdGains:
    """Stiffness [N m/rad] and damping [N m s/rad] of n joints."""

    kp: tuple[float, ...]
    kd: tuple[float, ...]


def read_gains(node: Node, joints: Sequence[str]) -> PdGains:
    """The parameters `kp` and `kd`, each a number, a list, or a dict by joint.

    Raises:
        ParameterError: missing, below zero, not finite, wrong length or joint names.
    """
    kp, kd = (per_joint(node, name, joints, minimum=0.0) for name in ("kp", "kd"))
    return PdGains(tuple(kp), tuple(kd))


class LiveGains:
    """The gains as live parameters: `kp_<joint>`, `kd_<joint>`, and `kp_all`, `kd_all`, which set every joint and show the largest.

    Args:
        node: the controller's namespace.
        joints: in the order of the gains.
        gains: at the start.
    """

    def __init__(self, node: Node, joints: Sequence[str], gains: PdGains) -> None:
        self._node, self.gains = node, gains
        self._names = {kind: [f"{kind}_{re.sub(r'[^A-Za-z0-9_]', '_', joint)}" for joint in joints] for kind in ("kp", "kd")}

    def parameters(self) -> list[LiveParameter]:
        """What to offer, with the present gains as defaults."""
        values = self.values()
        unit = {"kp": "stiffness [N m/rad]", "kd": "damping [N m s/rad]"}
        return [
            LiveParameter(name, value, 0.0, LARGEST, f"{unit[name[:2]]}, not below zero" + ("; sets all joints" if name.endswith("_all") else ""))
            for name, value in values.items()
        ]

    def values(self) -> dict[str, float]:
        """All live values as they are in force."""
        result: dict[str, float] = {}
        for kind, gains in (("kp", self.gains.kp), ("kd", self.gains.kd)):
            result[f"{kind}_all"] = max(gains)
            result.update(zip(self._names[kind], gains, strict=True))
        return result

    def wanted(self, values: dict[str, Any]) -> PdGains:
        """The gains that these live values ask for; nothing is changed yet.

        Raises:
            ParameterError: a value below zero or not finite.
        """
        before = self.values()
        for name, value in values.items():
            if not is_number(value) or value < 0.0:
                raise ParameterError(f"{self._node.resolve(name)} is {value!r}; valid: a finite number, not below zero")
        kp, kd = (self._asked(kind, before, values) for kind in ("kp", "kd"))
        return PdGains(kp, kd)

    def _asked(self, kind: str, before: dict[str, float], values: dict[str, Any]) -> tuple[float, ...]:
        together = values.get(f"{kind}_all", before[f"{kind}_all"])
        if together != before[f"{kind}_all"]:
            return (float(together),) * len(self._names[kind])
        return tuple(float(values.get(name, before[name])) for name in self._names[kind])

    def publish_start(self) -> None:
        """Put the gains of the YAML on the parameter server under their live names: what an earlier run left there must not win."""
        for name, value in self.values().items():
            self._node.set_param(name, value)
