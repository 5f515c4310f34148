"""The energy tank keeps the account: a law on a free mass never gives more than the tank had at the start."""

import math

import numpy as np
import pytest

from hric_controllers.cartesian.energy_tank import RESERVE, EnergyTank
from hric_controllers.cartesian.law import CartesianArmState, CartesianLaw, Compliance
from hric_core.geometry import Pose

DT = 1e-4
LOW = 2e-3
"""Damping ratio that takes just what a torque held for a cycle adds to the energy of a spring."""
SOFT, STIFF = 100.0, 400.0
"""Stiffnesses between which the pump switches [N/m]."""
JACOBIAN = np.vstack([np.eye(3), np.zeros((3, 3))])


def gains(stiffness, damping=0.0):
    return Compliance(stiffness, 0.0, damping, 0.0, 0.0)


class FreeMass:
    """Mass of 1 kg that three prismatic joints guide, exact between two cycles, under the law and its tank."""

    def __init__(self, x, stiffness, initial=None, damping=0.0, largest=100.0):
        self.x, self.v = np.array(x, dtype=float), np.zeros(3)
        self.law = CartesianLaw(gains(stiffness, damping), 0.0)
        self.law.start(Pose(), [0.0] * 3)
        self.start = self.law.energy(self.measured)
        self.tank = None if initial is None else EnergyTank(initial, largest)
        if self.tank:
            self.tank.start(self.law, self.start, self.x)
        self.blocked, self.given, self.rows = False, 0.0, []

    @property
    def measured(self):
        return Pose(tuple(self.x.tolist()), (0.0, 0.0, 0.0, 1.0))

    def step(self, force=(0.0, 0.0, 0.0), added=(0.0, 0.0, 0.0)):
        """Run one cycle; `force`: of the environment on the mass, `added`: torque beyond the law [N]."""
        self.law.advance(DT)
        if self.tank:
            self.tank.advance(self.law, self.measured, self.x, 0.0)
        arm = CartesianArmState(self.x.tolist(), self.v.tolist(), JACOBIAN, np.eye(3), np.zeros(3))
        tau = [a + b for a, b in zip(self.law.torque(self.measured, arm), added, strict=True)]
        if self.tank:
            tau = self.tank.admitted(self.law, arm, tau, DT)
            self.tank.hold(tau)
        a = np.array(tau) + force
        step = np.zeros(3) if self.blocked else self.v * DT + 0.5 * a * DT**2
        self.given += float(np.array(force) @ step)
        self.x += step
        self.v = np.zeros(3) if self.blocked else self.v + a * DT
        self.rows.append((0.5 * float(self.v @ self.v), self.law.energy(self.measured), float(self.x[0])))
        return tau


def pumped(initial, switches):
    """Switch to the stiff spring at each turning point and to the soft one at each passage; return the mass."""
    mass = FreeMass((0.1, 0.0, 0.0), STIFF, initial, LOW)
    side, done = 1.0, 0
    while done < switches:
        before = mass.v[0]
        mass.step()
        if mass.x[0] * side < 0.0:
            side, done = -side, done + 1
            mass.law.target_compliance = gains(SOFT, LOW)
        elif before * mass.v[0] < 0.0:
            done += 1
            mass.law.target_compliance = gains(STIFF, LOW)
    return mass


def test_without_a_tank_switching_of_the_stiffness_doubles_the_swing_each_time():
    swing = np.abs(np.array(pumped(None, 9).rows)[:, 2])
    peaks = [x for a, x, b in zip(swing, swing[1:], swing[2:], strict=False) if a < x > b]
    assert peaks[:4] == pytest.approx([0.1 * math.sqrt(STIFF / SOFT) ** n for n in range(1, 5)], rel=0.05)


@pytest.mark.parametrize("initial", [0.5, 3.0])
def test_the_pumped_mass_gets_no_more_than_the_tank_and_the_spring_had(initial):
    mass = pumped(initial, 20)
    kinetic, stored, _ = np.array(mass.rows).T
    total = mass.start + initial
    assert (kinetic + stored).max() <= total + 1e-9
    assert (kinetic + stored).max() == pytest.approx(total - RESERVE * initial, rel=0.02)
    assert mass.tank.energy >= 0.9 * RESERVE * initial


def test_at_a_rigid_wall_the_force_is_that_of_the_energy_in_the_tank():
    mass = FreeMass((0.0, 0.0, 0.0), SOFT, 0.3)
    mass.blocked = True
    mass.law.target = Pose((0.5, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    for _ in range(5000):
        tau = mass.step()
    assert tau[0] == pytest.approx(math.sqrt(2.0 * SOFT * (1.0 - RESERVE) * 0.3), rel=1e-3)
    mass.law.target = Pose()
    mass.step()
    assert mass.tank.energy == pytest.approx(0.3)


def test_with_enough_energy_nothing_is_scaled():
    free, kept = FreeMass((0.0, 0.0, 0.0), SOFT, None, 0.7), FreeMass((0.0, 0.0, 0.0), SOFT, 50.0, 0.7)
    for mass in (free, kept):
        mass.law.target = Pose((0.2, 0.1, 0.0), (0.0, 0.0, 0.0, 1.0))
        for _ in range(4000):
            mass.step(added=(1.0, 0.0, 0.0))
    assert np.array_equal(free.x, kept.x)


def test_a_mass_that_is_led_gives_back_what_it_got_and_no_more_than_the_tank():
    """Someone pulls the mass to and fro while equilibrium, stiffness and a constant force change at random."""
    random = np.random.default_rng(4)
    mass, lowest = FreeMass((0.0, 0.0, 0.0), SOFT, 0.4, 0.3, largest=1.0), 0.0
    for cycle in range(30000):
        if cycle % 1000 == 0:
            mass.law.target = Pose(tuple(random.uniform(-0.3, 0.3, 3).tolist()), (0.0, 0.0, 0.0, 1.0))
            mass.law.target_compliance = gains(float(random.uniform(20.0, 800.0)), 0.3)
            added = random.uniform(-10.0, 10.0, 3)
        force = random.uniform(-5.0, 5.0) * np.ones(3) * math.sin(3.0 * DT * cycle)
        mass.step(force, added)
        kinetic, stored, _ = mass.rows[-1]
        lowest = min(lowest, 0.4 + mass.given - kinetic - stored)
        assert mass.tank.energy <= 1.0
    assert lowest >= -1e-9
    assert mass.tank.energy > 0.0
