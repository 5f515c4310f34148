"""The plant's parameters: those that all plants share, and OpenSim's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from hric_control.errors import ParameterError
from hric_control.plants.config import DEFAULTS, PlantConfig, number

OWN: dict[str, Any] = {"accuracy": 1e-3, "effort_limits": True}
"""Keys and defaults beyond those of all plants; INTERFACE.md says what they mean."""


@dataclass(frozen=True)
class OpenSimConfig(PlantConfig):
    """Checked parameters; the keys of `defaults`."""

    defaults: ClassVar[Mapping[str, Any]] = {**DEFAULTS, **OWN}

    accuracy: float
    effort_limits: bool

    @classmethod
    def check(cls, values: dict[str, Any], joint_names: Sequence[str]) -> None:
        """See the base. A window is refused: OpenSim's own needs a display and would take the loop's time."""
        super().check(values, joint_names)
        values["accuracy"] = number(values["accuracy"], "plant/accuracy", positive=True)
        if not isinstance(values["effort_limits"], bool):
            raise ParameterError(f"plant/effort_limits must be true or false; got {values['effort_limits']!r}")
        if values["gui"]:
            raise ParameterError("plant/gui: the OpenSim plant has no window of its own. Give gui: false, and look at the robot in rviz")
