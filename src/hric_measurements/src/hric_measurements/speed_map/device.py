"""Virtual measuring device: a mass with a spring of a body region's stiffness; its force is read each millisecond.

The device touches the end effector from the first instant and moves along one direction only; at first it moves towards
the arm if the closing speed is higher than the arm's speed. A pad may lie on the spring. An infinite mass is a device
that is fixed to a rigid support. Filter and film of a real device (ISO/PAS 5672) are in `hric_measurements.contact`.
"""

from dataclasses import dataclass, field

from hric_control.plants.contact_law import ContactLaw, Layer, in_series
from hric_control.plants.spring_step import Springs

PAIR = ("device", "arm")


@dataclass(frozen=True)
class HitBody:
    """Mass and spring of the device, which represent the body region that the arm hits.

    Attributes:
        mass: mass behind the spring, free to move along the direction [kg].
        stiffness: stiffness of the spring [N/m].
        damping: damping of the spring [N s/m]; with a pad, the pad damps instead.
        pad: viscoelastic layer on the spring; None: there is none.
    """

    mass: float
    stiffness: float
    damping: float = 0.0
    pad: Layer | None = None

    @property
    def law(self) -> ContactLaw:
        """Law of the device's force."""
        spring = ContactLaw(self.stiffness, self.damping)
        return spring if self.pad is None else in_series([spring, ContactLaw(self.pad.stiffness, layers=(self.pad,))])


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
        readings: force at each time step [N].
        energy: largest work of arm and device on the spring so far [J].
        apart: True if arm and device have touched and separated again.
    """

    body: HitBody
    robot_mass: float
    time_step: float
    approach: float = 0.0
    peak: float = 0.0
    energy: float = 0.0
    readings: list[float] = field(default_factory=list)
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
        self._springs.begin()
        inverse_mass = 1.0 / self.robot_mass + 1.0 / self.body.mass
        done = self._springs.push(PAIR, depth, closing, measured, inverse_mass, self.body.law)
        self.energy = max(self.energy, self._springs.energy(PAIR))
        self.readings.append(done.reading)
        acceleration = done.mean / self.body.mass
        self._travel += self.time_step * (self._speed + 0.5 * self.time_step * acceleration)
        self._speed += self.time_step * acceleration
        self._closing = closing
        self.peak = max(self.peak, done.reading)
        self.apart = self.peak > 0.0 and depth < 0.0 and closing < 0.0
        return done.mean
