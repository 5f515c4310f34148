"""Virtual measuring device: a mass with a spring of a body region's stiffness; its force is read each millisecond.

The device touches the end effector from the first instant and moves along one direction only; at first it moves towards
the arm if the closing speed is higher than the arm's speed. Unlike a real device (ISO/PAS 5672) it has no extension, no
foil and no mounting.
"""

from dataclasses import dataclass, field

from hric_control.plants.spring_step import Springs

PAIR = ("device", "arm")


@dataclass(frozen=True)
class HitBody:
    """Mass and spring of the device, which represent the body region that the arm hits.

    Attributes:
        mass: mass behind the spring, free to move along the direction [kg].
        stiffness: stiffness of the spring [N/m].
        damping: damping of the spring [N s/m].
    """

    mass: float
    stiffness: float
    damping: float = 0.0


@dataclass
class MeasuringDevice:
    """State of the measuring device during one impact.

    Args:
        body: mass and spring of the device.
        robot_mass: reflected mass of the arm along the direction [kg], for the motion within a time step; the physics
            engine moves the arm from step to step.
        time_step: time between two readings [s].
        approach: initial speed of the device towards the arm [m/s].

    Attributes:
        peak: peak force so far [N].
        apart: True if arm and device have touched and separated again.
    """

    body: HitBody
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
        """Advance the device by one time step; return the mean force on the arm in this step [N].

        Args:
            travel: distance along the direction that the arm has moved since the first touch, at the step's start [m].
            speed: speed of the arm along the direction [m/s].
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
