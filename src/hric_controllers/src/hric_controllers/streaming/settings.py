"""Parameters of the Cartesian streaming controller."""

import math
from dataclasses import dataclass

from hric_controllers import parameters
from hric_controllers.cartesian.workspace import Box
from hric_controllers.marker.parameters import Rotation, Translation, Workspace, check_arm_limits
from hric_controllers.streaming.follower import StreamLimits
from hric_core.parameters import Settings, number, section


@dataclass(frozen=True)
class CartesianStreamingSettings(Settings):
    """Parameters of the Cartesian streaming controller."""

    translation: Translation = section(Translation)
    rotation: Rotation = section(Rotation)
    largest_turn: float = number(
        2.5, above=0.0, maximum=3.0, unit="rad", text="largest turn from the orientation at the start"
    )
    workspace: Box = section(Workspace)
    state_publish_rate: float = parameters.state_rate(100.0)

    def check(self, where: str) -> None:
        """Raise an error if a limit is above that of the arm."""
        check_arm_limits(where, self.translation, self.rotation)

    @property
    def limits(self) -> StreamLimits:
        """Limits of the three translations and the three rotations."""
        each = [self.translation.each_of(3)] * 3 + [self.rotation.each_of(3)] * 3
        return StreamLimits(
            tuple(axis.velocity for axis in each),
            tuple(axis.acceleration for axis in each),
            tuple(axis.jerk for axis in each),
        )

    @property
    def ranges(self) -> list[tuple[float, float]]:
        """Range of each of these six axes [m], [rad]."""
        box = self.workspace
        return [*zip(box.lower, box.upper, strict=True), *[(-math.pi, math.pi)] * 3]
