"""External wrenches on bodies, each for a limited number of steps or until cleared."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray


@dataclass
class Wrench:
    """External wrench on a body.

    Attributes:
        body: name "model::link"; for the robot's links, the model is the robot's name.
        force, torque: force and torque in the world frame, shape (3,) [N], [N m].
        point: point of application in the link frame, shape (3,) [m].
        steps_left: number of steps for which the wrench still acts; negative: until it is cleared.
    """

    body: str
    force: FloatArray
    torque: FloatArray
    point: FloatArray
    steps_left: int


@dataclass
class Wrenches:
    """External wrenches that act now.

    Args:
        time_step: time step of the plant [s].
    """

    time_step: float
    active: list[Wrench] = field(default_factory=list)

    def add(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Add a wrench for `duration` [s] (negative: until cleared); for the other arguments see `Wrench`.

        Raises:
            ParameterError: force, torque or point does not have three finite numbers.
        """
        F, T, p = (np.array(v, dtype=float) for v in (force, torque, point))
        if any(v.shape != (3,) or not np.isfinite(v).all() for v in (F, T, p)):
            raise ParameterError(
                f"wrench on {body}: force, torque and point must be three finite numbers each; got {force}, "
                f"{torque}, {point}"
            )
        steps = -1 if duration < 0.0 else round(duration / self.time_step)
        if steps != 0:
            self.active.append(Wrench(body, F, T, p, steps))

    def count_step(self) -> None:
        """Count a step of the plant, and remove the wrenches whose time is over."""
        if not self.active:
            return
        for wrench in self.active:
            wrench.steps_left -= 1
        self.active = [wrench for wrench in self.active if wrench.steps_left != 0]

    def clear(self) -> None:
        """Remove all wrenches."""
        self.active.clear()

    def clear_link(self, body: str) -> None:
        """Remove the wrenches on one "model::link"."""
        self.active = [wrench for wrench in self.active if wrench.body != body]

    def clear_model(self, model: str) -> None:
        """Remove the wrenches on all links of a model."""
        self.active = [wrench for wrench in self.active if not wrench.body.startswith(f"{model}::")]
