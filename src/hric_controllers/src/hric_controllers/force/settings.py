"""Parameters of the force controller."""

from dataclasses import dataclass

from hric_controllers.force.force_axis import ForceGains
from hric_core.errors import CommandError
from hric_core.geometry import Vector
from hric_core.parameters import Settings, choice, listing, number, numbers, refused, section

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Stroke(Settings):
    """Motion to and fro along an axis of the task frame, while all force axes are in contact."""

    axis: str = choice("x", "y", "z", text="axis of the task frame along which the end effector moves")
    length: float = number(0.0, minimum=0.0, maximum=0.5, unit="m", text="length of the line; 0: no motion")
    speed: float = number(0.05, above=0.0, maximum=0.25, unit="m/s", text="speed between the turning points")
    acceleration: float = number(0.25, above=0.0, maximum=2.0, unit="m/s^2", text="acceleration at the turning points")

    def check(self, where: str) -> None:
        """Refuse a line on which the speed is not reached."""
        if 0.0 < self.length < self.speed**2 / self.acceleration:
            raise refused(
                f"{where}length", self.length, f"0, or {self.speed**2 / self.acceleration:.3g} m or more at this speed"
            )

    def state(self, time: float) -> tuple[float, float]:
        """Return displacement from the middle [m] and velocity [m/s] at a time of the motion [s]; 0 s: the middle."""
        ramp = self.speed / self.acceleration
        half = self.length / self.speed + ramp
        back, u = divmod((time + 0.5 * half) % (2.0 * half), half)
        x, v = self.speed * (u - 0.5 * half), self.speed
        if u < ramp:
            x, v = 0.5 * (self.acceleration * u**2 - self.length), self.acceleration * u
        elif half - u < ramp:
            x, v = 0.5 * (self.length - self.acceleration * (half - u) ** 2), self.acceleration * (half - u)
        return (-x, -v) if back else (x, v)


@dataclass(frozen=True)
class ForceSettings(Settings):
    """Parameters of the force controller. All defaults are project defaults, unconfirmed."""

    frame: str = choice(
        "end_effector",
        "base",
        text="orientation of the task frame: that of the equilibrium pose, whose z axis points out of the hand, or "
        "that of `<arm_id>_link0`",
    )
    axes: tuple[str, ...] = listing(
        choice(*AXES),
        range(1, 4),
        ("z",),
        different=True,
        text="axes of the task frame along which force is controlled",
    )
    force: Vector = numbers(
        3, (0.0, 0.0, 10.0), unit="N", text="desired force on the surface at the start, in the task frame; all 0: none"
    )
    largest_force: float = number(30.0, above=0.0, maximum=100.0, unit="N", text="a larger desired force is refused")
    integral_gain: float = number(15.0, minimum=0.0, maximum=100.0, unit="1/s", text="integral gain of the force error")
    integral_limit: float = number(10.0, minimum=0.0, maximum=50.0, unit="N", text="largest force of the integral term")
    contact_damping: float = number(
        200.0, minimum=0.0, maximum=500.0, unit="N s/m", text="damping along the force axes in contact"
    )
    approach_damping: float = number(
        300.0,
        above=0.0,
        maximum=1000.0,
        unit="N s/m",
        text="gain of the speed control in the approach, and additional damping in contact above the approach speed",
    )
    approach_speed: float = number(
        0.02,
        above=0.0,
        maximum=0.1,
        unit="m/s",
        text="speed towards the surface, before contact and after loss of contact",
    )
    approach_distance: float = number(
        0.2,
        above=0.0,
        maximum=2.0,
        unit="m",
        text="distance of an approach without contact after which the arm stops, as with a desired force of 0",
    )
    contact_force: float = number(
        2.0,
        above=0.0,
        maximum=20.0,
        unit="N",
        text="estimated force at which contact begins; it ends below half of this force",
    )
    force_rate: float = number(
        20.0,
        above=0.0,
        maximum=1000.0,
        unit="N/s",
        text="rate at which the controlled force approaches the desired one in contact",
    )
    tare_time: float = number(
        0.2,
        minimum=0.001,
        maximum=5.0,
        unit="s",
        text="time after the start during which the arm holds still and must not be touched; the mean estimated wrench "
        "of its second half is subtracted from then on",
    )
    retract: float = number(
        0.03, minimum=0.0, maximum=0.3, unit="m", text="distance to move back when the desired force becomes 0"
    )
    stroke: Stroke = section(Stroke)

    def check(self, where: str) -> None:
        """Refuse forces that the controller cannot hold, and a stroke along a force axis."""
        try:
            desired = self.desired(self.force)
        except CommandError as error:
            raise refused(f"{where}force", list(self.force), str(error)) from None
        lowest = min([self.approach_damping * self.approach_speed, *map(abs, desired.values())])
        if self.contact_force >= lowest:
            text = f"below {lowest:.3g} N, the lower of the desired force and approach_damping times approach_speed"
            raise refused(f"{where}contact_force", self.contact_force, text)
        if self.stroke.length > 0.0 and self.stroke.axis in self.axes:
            others = ", ".join(axis for axis in AXES if axis not in self.axes) or "no stroke with three force axes"
            raise refused(f"{where}stroke/axis", self.stroke.axis, others)

    def desired(self, force: Vector) -> dict[int, float]:
        """Return the desired force [N] by index of its axis, 0 to 2; empty: no force. Raises CommandError."""
        chosen = [AXES.index(axis) for axis in self.axes]
        if not any(force):
            return {}
        if any(force[k] for k in range(3) if k not in chosen) or not all(force[k] for k in chosen):
            raise CommandError(f"a force along each of {', '.join(self.axes)} and along no other axis, or none at all")
        if max(map(abs, force)) > self.largest_force or min(abs(force[k]) for k in chosen) <= self.contact_force:
            raise CommandError(f"above {self.contact_force:g} N (contact_force) up to {self.largest_force:g} N")
        return {k: force[k] for k in chosen}

    def gains(self) -> ForceGains:
        """Return the gains of the force axes."""
        return ForceGains(
            self.integral_gain,
            self.integral_limit,
            self.contact_damping,
            self.approach_damping,
            self.approach_speed,
            self.contact_force,
            self.force_rate,
        )
