"""Random approaches: body, speed and direction of the person, and the simultaneous motion of the arm."""

import math
from dataclasses import dataclass

import numpy as np

from hric_sweep.approaches.contact_events import LONGEST

SPEEDS = (0.5, 2.0)
"""Range of the peak speed of the walk [m/s], which the person reaches at the aim point."""
PEAK = 1.875
"""Ratio of peak to mean speed of a minimum-jerk motion."""
SUBJECTS = ("P05_female", "P50_female", "P50_male", "P95_male")
BEARING = math.radians(100.0)
"""Largest angle between the base's x axis and the person's start [rad]: the arm works in front of the base."""
CONTROLLER = "joint_pd_controller"
SWING = 1.5
"""Time between two setpoints of the arm [s]."""
BEGIN = 0.5
"""Start of the arm's motion [s]: after the supervisor's first request has taken effect, which takes 0.34 s."""


@dataclass(frozen=True)
class RandomApproach:
    """Random approach of a person to the working arm.

    Attributes:
        seed: seed of the random draw.
        speed: peak speed of the walk [m/s].
        bearing: direction from which the person comes, as angle from the base's x axis towards y [rad].
        aim: x and y, in the world frame, of the point at which the walk has its peak speed [m].
        distance: distance between start and aim [m].
        subject: code of the person's body.
        arms: flexion of right shoulder, right elbow, left shoulder, left elbow [rad].
        setpoints: joint positions for the robot arm, one setpoint every SWING seconds, 7 floats each [rad].
        phase: delay of the start of the walk after the start of the run [s].
    """

    seed: int
    speed: float
    bearing: float
    aim: tuple[float, float]
    distance: float
    subject: str
    arms: tuple[float, float, float, float]
    setpoints: tuple[tuple[float, ...], ...]
    phase: float

    @property
    def reached(self) -> float:
        """Time at which the person reaches the aim point [s]."""
        return self.phase + PEAK * self.distance / self.speed

    @property
    def duration(self) -> float:
        """Duration of a run without contact [s]."""
        return round(self.reached + 0.4, 3)

    def changes(self) -> dict[str, object]:
        """Return the overrides of the experiment; its duration leaves time for a contact at the end of the walk."""
        away = np.array([math.cos(self.bearing), math.sin(self.bearing)])
        start = np.array(self.aim) + self.distance * away
        path = (-2.0 * self.distance * away).tolist()
        end = self.phase + 2.0 * PEAK * self.distance / self.speed
        joints = ("right_sh_flex", "right_el_flex", "left_sh_flex", "left_el_flex")
        posture = {"time": 0.0, **dict(zip(joints, self.arms, strict=True))}
        sent = [
            {"time": round(BEGIN + SWING * k, 3), "controller": CONTROLLER, "positions": list(row)}
            for k, row in enumerate(self.setpoints)
            if BEGIN + SWING * k < self.duration + LONGEST
        ]
        return {
            "human.subject": self.subject,
            "human.position": start.tolist(),
            "human.heading": self.bearing + math.pi,
            "human.walk.points": [[self.phase, 0.0, 0.0], [end, *path]],
            "human.control": {"parameters": {"reference": {"program": "joints", "points": [posture]}}},
            "setpoints": sent,
            "duration": self.duration + LONGEST,
        }


def changes(seed: int) -> dict[str, object]:
    """Return the experiment overrides of the random approach drawn from a seed: a row of the sweep `approaches`."""
    return draw(seed).changes()


def draw(seed: int) -> RandomApproach:
    """Draw the random approach that belongs to a seed."""
    random = np.random.default_rng(seed)
    speed = float(random.uniform(*SPEEDS))
    bearing = float(random.uniform(-BEARING, BEARING))
    far, side = random.uniform(0.3, 0.6), random.uniform(-0.25, 0.25)
    aim = (
        float(far * math.cos(bearing) - side * math.sin(bearing)),
        float(far * math.sin(bearing) + side * math.cos(bearing)),
    )
    # Far enough that the arm reaches full speed before a fast person arrives.
    distance = float(0.9 + 0.6 * speed + random.uniform(0.0, 0.3))
    arms = tuple(float(random.uniform(low, high)) for low, high in ((0.0, 1.5), (0.2, 1.6)) * 2)
    middle = np.clip(bearing, -1.2, 1.2)
    rows = []
    for k in range(8):
        yaw = middle + (0.7 if k % 2 else -0.7) + random.uniform(-0.3, 0.3)
        lift, bend = random.uniform(-0.3, 0.4), random.uniform(-2.5, -1.9)
        rows.append((float(yaw), float(lift), 0.0, float(bend), 0.0, float(random.uniform(2.0, 2.4)), math.pi / 4))
    return RandomApproach(
        seed,
        speed,
        bearing,
        aim,
        distance,
        str(random.choice(SUBJECTS)),
        (arms[0], arms[1], arms[2], arms[3]),
        tuple(rows),
        float(random.uniform(0.0, 0.4)),
    )
