"""Force axis that presses a mass on a spring: approach, contact, its loss, anti-windup; strokes; bad settings."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hric_controllers.force.force_axis import LOST_AFTER, ForceAxis, ForceGains
from hric_controllers.force.settings import ForceSettings, Stroke
from hric_core.errors import ParameterError

PERIOD, MASS, LAG = 1e-3, 4.0, 0.008
"""Cycle [s], mass of the end effector [kg], and lag of the estimated force [s]."""
GAINS = ForceGains(
    integral=15.0,
    integral_limit=10.0,
    damping=200.0,
    approach_damping=300.0,
    approach_speed=0.02,
    contact_force=2.0,
    force_rate=20.0,
)


class Pressed:
    """Mass that a force axis pushes against a spring at a distance.

    Attributes:
        force, velocity: of each cycle [N], [m/s].
    """

    def __init__(self, gains: ForceGains = GAINS, gap: float = 0.01, sign: float = 1.0) -> None:
        self.axis, self.sign, self.gap, self.stiffness, self.pace = ForceAxis(gains), sign, gap, 20000.0, 1.0
        self.x = self.v = self.felt = 0.0
        self.force: list[float] = []
        self.velocity: list[float] = []

    def run(self, seconds: float, desired: float = 10.0, disturbance: float = 0.0, limit: float = math.inf) -> None:
        for _ in range(round(seconds / PERIOD)):
            felt, v = self.sign * self.felt, self.sign * self.v
            push = self.axis.advance(self.sign * desired, felt, v, PERIOD, limit, self.pace)
            force = self.stiffness * max(0.0, self.x - self.gap)
            self.v += (self.sign * push + disturbance - force) / MASS * PERIOD
            self.x += self.v * PERIOD
            self.felt += (force - self.felt) * PERIOD / LAG
            self.force.append(force)
            self.velocity.append(self.v)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_force_is_reached_without_a_steady_error_against_a_disturbance(sign: float) -> None:
    pressed = Pressed(sign=sign)
    pressed.run(4.0, disturbance=-3.0)
    assert pressed.force[-1] == pytest.approx(10.0, abs=0.01)
    assert max(pressed.force) < 13.0


def test_the_approach_keeps_its_speed_until_contact() -> None:
    pressed = Pressed(gap=1.0)
    pressed.run(1.0)
    assert max(pressed.velocity) <= 0.022 and pressed.velocity[-1] == pytest.approx(0.02, rel=1e-2)


@pytest.mark.parametrize("pace", [0.0, 0.5])
def test_the_approach_is_as_slow_as_the_speed_scale_asks(pace: float) -> None:
    pressed = Pressed(gap=1.0)
    pressed.run(0.5)
    pressed.pace = pace
    pressed.run(1.0)
    assert pressed.velocity[-1] == pytest.approx(pace * 0.02, abs=2e-4)


def test_without_a_surface_any_more_the_arm_soon_moves_at_the_approach_speed_and_never_much_faster() -> None:
    pressed = Pressed()
    pressed.run(3.0)
    assert pressed.axis.touching
    pressed.gap, pressed.velocity = 1.0, []
    pressed.run(1.0)
    assert not pressed.axis.touching
    assert max(pressed.velocity) < 0.04
    assert pressed.velocity[300:] == pytest.approx([0.02] * 700, rel=0.1)


def test_a_bounce_is_no_loss_of_contact() -> None:
    axis = ForceAxis(GAINS)
    axis.advance(10.0, 5.0, 0.0, PERIOD)
    for _ in range(round(LOST_AFTER / PERIOD) - 2):
        axis.advance(10.0, 0.0, 0.0, PERIOD)
    assert axis.touching
    axis.advance(10.0, 5.0, 0.0, PERIOD)
    axis.advance(10.0, 0.0, 0.0, PERIOD)
    assert axis.touching


def test_the_integral_does_not_wind_up_while_the_push_is_limited() -> None:
    """A disturbance that the limited push cannot balance for 3 s leaves no overshoot behind."""
    pressed = Pressed()
    pressed.run(2.0)
    pressed.run(3.0, disturbance=-6.0, limit=10.0)
    assert pressed.force[-1] == pytest.approx(4.0, abs=0.1)
    pressed.force = []
    pressed.run(1.0)
    assert max(pressed.force) < 15.0  # as after any step of 6 N; with a wound-up integral above 20
    wound = Pressed(replace(GAINS, integral_limit=2.5))
    wound.run(4.0, disturbance=-3.0)
    assert wound.force[-1] == pytest.approx(9.5, abs=0.01)


def test_a_stroke_moves_at_its_speed_and_its_velocity_is_the_slope() -> None:
    stroke = Stroke(axis="y", length=0.08, speed=0.05, acceleration=0.25)
    times = np.arange(0.0, 8.0, PERIOD)
    x, v = np.array([stroke.state(float(time)) for time in times]).T
    assert x[0] == 0.0 and x.max() == pytest.approx(0.04, abs=1e-6) and x.min() == pytest.approx(-0.04, abs=1e-6)
    np.testing.assert_allclose(np.gradient(x, PERIOD)[1:-1], v[1:-1], atol=1.5e-4)
    assert np.abs(np.diff(v)).max() <= 0.25 * PERIOD * 1.001
    assert np.abs(v).max() == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"force": [0.0, 5.0, 10.0]}, "force is .*valid: a force along each of z and along no other axis"),
        ({"force": [0.0, 0.0, 50.0]}, r"force is .*valid: above 2 N \(contact_force\) up to 30 N"),
        ({"force": [0.0, 0.0, 1.0]}, r"force is .*valid: above 2 N"),
        ({"axes": ["w"]}, "axes.*'w'.*x, y, z"),
        ({"axes": []}, "axes"),
        ({"contact_force": 7.0}, "contact_force is 7.0; valid: below 6 N"),
        ({"approach_speed": 0.5}, "approach_speed is 0.5; valid: "),
        ({"stroke": {"axis": "z", "length": 0.1}}, "stroke/axis is 'z'; valid: x, y"),
        ({"stroke": {"length": 0.001}}, "stroke/length is 0.001; valid: 0, or 0.01"),
        ({"frame": "tool"}, "frame is 'tool'; valid: end_effector, base"),
    ],
)
def test_a_bad_parameter_is_refused_in_one_sentence(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ParameterError, match=words) as refusal:
        ForceSettings.of(changes, "force_controller/")
    assert "\n" not in str(refusal.value)
