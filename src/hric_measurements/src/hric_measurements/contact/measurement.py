"""Contact of a simulated arm with the virtual measuring device, at one place of the workspace."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hric_assessment.contact.classes import ContactClass
from hric_assessment.contact.limits import Limits
from hric_core.errors import HricError
from hric_measurements.speed_map.blow import ArmBehaviour, Blows, ImpactApproach, simulated_arm
from hric_measurements.speed_map.device import HitBody, MeasuringDevice
from hric_measurements.speed_map.grid import DIRECTIONS, Postures
from hric_measurements.speed_map.measured import MapRequest

DURATION = 1.0
"""Longest time that is measured [s]: the transient half second and the quasi-static one after it."""


@dataclass(frozen=True)
class DeviceContact:
    """Contact of an arm with the measuring device.

    Attributes:
        region: body region that the device represents.
        body: mass and spring of the device; an infinite mass is fixed to a rigid support.
        position: position of the end effector in the base frame, 3 floats [m].
        direction: direction of its motion, one of DIRECTIONS.
        speed: closing speed [m/s].
    """

    region: str
    body: HitBody
    position: Sequence[float]
    direction: str
    speed: float

    def measure(self, limits: Limits, overrides: Sequence[str]) -> tuple[ImpactApproach, MeasuringDevice]:
        """Simulate the contact; return the arm's motion before it, and the device with its readings.

        Args:
            limits: limits of the body regions.
            overrides: overrides of the experiment's values, `key:=value`.

        Raises:
            HricError: no contact with the region is permitted, an override is wrong, or the position is out of reach.
        """
        MapRequest(self.region, limits, self.body.damping, ArmBehaviour.DRIVEN).check()
        with simulated_arm(overrides) as robot:
            point, blows = np.array(self.position), Blows(robot, ArmBehaviour.DRIVEN)
            if (q := Postures(robot).at(point)) is None:
                raise HricError(f"--position {point.tolist()} is out of reach; valid: a point in the arm's workspace")
            approach = blows.approach(q, np.array(DIRECTIONS[self.direction]))
            return approach, blows.measured(approach, self.body, self.speed, DURATION)

    def facts(self, approach: ImpactApproach) -> Mapping[str, str]:
        """Return a description of the contact by name, for the sheet; `approach`: motion of the arm before it."""
        body, clamped = self.body, math.isinf(self.body.mass)
        kind = ContactClass.CLAMPED if clamped else ContactClass.FREE
        support = "fixed to a rigid support" if clamped else f"free to move, {body.mass:g} kg"
        pad = (
            "none"
            if body.pad is None
            else f"{body.pad.stiffness:g} and {body.pad.relaxing:g} N/m, {body.pad.relaxation_time:g} s"
        )
        return {
            "body region": self.region,
            "class of the contact": f"{kind}: the device is {support}",
            "position": f"{' '.join(map(str, self.position))} m, moving along {self.direction}",
            "closing speed": f"{self.speed:g} m/s",
            "joint positions": f"{' '.join(map(str, approach.q.round(3).tolist()))} rad",
            "reflected mass of the arm": f"{approach.mass:.2f} kg along the direction, as simulated",
            "spring of the device": f"{body.stiffness:g} N/m (ISO/TS 15066:2016), damping {body.damping:g} N s/m",
            "pad on the spring": pad,
        }
