"""A virtual measuring device: a spring with the stiffness of a region of the body before a mass, read each millisecond.

It is where the end effector is, so that it touches from the first instant on, and moves along one direction only, at
first towards the arm where both have to meet faster than the arm alone moves.
What a real device of ISO/PAS 5672 has and this one has not: its size, its foil, its mounting.
"""

from dataclasses import dataclass, field

from hric_control.plants.spring_step import Springs

PAIR = ("device", "arm")


@dataclass(frozen=True)
class Body:
    """What the arm meets.

    Attributes:
        mass: behind the spring, free to move along the direction [kg].
        stiffness: [N/m].
        damping: [N s/m].
    """

    mass: float
    stiffness: float
    damping: float = 0.0


@dataclass
class Device:
    """One measurement.

    Args:
        body: of which region.
        robot_mass: reflected mass of the arm along the direction [kg]; within a step alone: over steps the arm moves as
            its plant says.
        time_step: between two readings [s].
        approach: speed of the body towards the arm at first [m/s].

    Attributes:
        peak: largest force so far [N].
        apart: both have met, and are apart again.
    """

    body: Body
    robot_mass: float
    time_step: float
    approach: float = 0.0
    peak: float = 0.0
    apart: bool = False
    _travel: float = 0.0
    _speed: float = field(init=False)
    _closing: float | None = None
    _springs: Springs = field(init=False)

    def __post_init__(self) -> None:
        self._springs, self._speed = Springs(self.time_step), -self.approach

    def push(self, travel: float, speed: float) -> float:
        """One step; returns the mean force against the arm [N].

        Args:
            travel: of the arm along the direction since it touched, at the step's begin [m].
            speed: of the arm along it [m/s].
        """
        depth, closing = travel - self._travel, speed - self._speed
        measured = 0.0 if self._closing is None else (closing - self._closing) / self.time_step
        law = (self.body.stiffness, self.body.damping)
        self._springs.begin()
        done = self._springs.push(PAIR, depth, closing, measured, 1.0 / self.robot_mass + 1.0 / self.body.mass, law)
        acceleration = done.mean / self.body.mass
        self._travel += self.time_step * (self._speed + 0.5 * self.time_step * acceleration)
        self._speed += self.time_step * acceleration
        self._closing = closing
        self.peak = max(self.peak, done.reading)
        self.apart = self.peak > 0.0 and depth < 0.0 and closing < 0.0
        return done.mean
