"""The thesis's motion: KDL's trapezoid on straight lines, and targets that are ignored on the way."""

import itertools
import math
import random
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from hric_controllers.marker.motion import LineMotion
from hric_controllers.trajectory.trapezoid import TrapezoidProfile

KDL = """
#include <kdl/velocityprofile_trap.hpp>
#include <cstdio>
int main() {
  double velocity, acceleration, begin, end;
  while (scanf("%lf %lf %lf %lf", &velocity, &acceleration, &begin, &end) == 4) {
    KDL::VelocityProfile_Trap profile(velocity, acceleration);
    profile.SetProfile(begin, end);
    printf("%.17g", profile.Duration());
    for (int k = 0; k <= 100; ++k) {
      double t = profile.Duration() * k / 100;
      printf(" %.17g %.17g", profile.Pos(t), profile.Vel(t));
    }
    printf("\\n");
  }
}
"""
DT = 1e-3


@pytest.fixture(scope="module")
def kdl(tmp_path_factory):
    """Duration, then position and velocity at each hundredth of it, from KDL's own class."""
    compiler = shutil.which("g++")
    if compiler is None or not Path("/usr/include/kdl/velocityprofile_trap.hpp").exists():
        pytest.skip("no C++ compiler, or no headers of KDL")
    folder = tmp_path_factory.mktemp("kdl")
    (folder / "trap.cpp").write_text(KDL)
    subprocess.run(
        [compiler, "-I/usr/include/eigen3", "trap.cpp", "-lorocos-kdl", "-o", "trap"],
        cwd=folder,
        check=True,
        timeout=120,
    )

    def profiles(cases):
        lines = "".join(" ".join(f"{value!r}" for value in case) + "\n" for case in cases)
        done = subprocess.run([folder / "trap"], input=lines, capture_output=True, text=True, check=True, timeout=20)
        return [[float(word) for word in line.split()] for line in done.stdout.splitlines()]

    return profiles


def cases():
    """Velocity, acceleration, begin, end: triangles and trapezoids, both ways."""
    rng = random.Random(4)
    return [
        (rng.uniform(0.1, 1.7), rng.uniform(0.5, 10.0), rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0))
        for _ in range(300)
    ]


def test_the_trapezoid_equals_the_one_of_kdl(kdl):
    for case, (duration, *states) in zip(cases(), kdl(cases()), strict=True):
        velocity, acceleration, begin, end = case
        profile = TrapezoidProfile([velocity], [acceleration])
        profile.plan_from(0.0, [begin], [0.0], [end])
        assert profile.duration == pytest.approx(duration, abs=1e-12, rel=0)
        for k in range(101):
            (p,), (v,) = profile.sample(duration * k / 100)
            assert (p, v) == pytest.approx((states[2 * k], states[2 * k + 1]), abs=1e-12, rel=0), (case, k)


def test_the_trapezoid_equals_its_closed_form():
    for v, a, begin, end in cases():
        way = abs(end - begin)
        ramp = min(v / a, math.sqrt(way / a))
        duration = ramp + way / (a * ramp)
        profile = TrapezoidProfile([v], [a])
        profile.plan_from(0.0, [begin], [0.0], [end])
        assert profile.duration == pytest.approx(duration, abs=1e-12, rel=0)
        t = 0.4 * ramp
        for time, s in ((t, 0.5 * a * t * t), (0.5 * duration, 0.5 * way), (duration - t, way - 0.5 * a * t * t)):
            assert profile.sample(time)[0] == pytest.approx([begin + math.copysign(s, end - begin)], abs=1e-12, rel=0)


def run(motion, steps, orders=()):
    path = []
    for step in range(steps):
        for at, order in orders:
            if at == step:
                order()
        motion.advance(DT)
        path.append(motion.position)
    return np.array(path)


def test_the_line_is_straight_and_has_the_profile_along_it():
    motion = LineMotion(0.5, 2.0)
    motion.start([0.4, 0.0, 0.5])
    assert motion.go([0.7, -0.4, 0.5])
    path = run(motion, 1300)
    along = (path - [0.4, 0.0, 0.5]) @ [0.6, -0.8, 0.0]
    assert np.abs(path - [0.4, 0.0, 0.5] - np.outer(along, [0.6, -0.8, 0.0])).max() < 1e-12
    assert along[624] == pytest.approx(0.25, abs=1e-12)  # half way at half of 0.5/0.5 + 0.5/2 = 1.25 s
    assert motion.position == [0.7, -0.4, 0.5] and not motion.moving


def test_targets_on_the_way_are_ignored_and_the_next_after_it_is_taken():
    motion, taken = LineMotion(0.5, 2.0), []
    orders = [(step, lambda: taken.append(motion.go([0.1, 0.0, 0.0]))) for step in (0, 100, 600)]
    orders[1] = (100, lambda: taken.append(motion.go([-5.0, 0.0, 0.0])))
    run(motion, 700, orders)
    assert taken == [True, False, True]
    assert motion.position == [0.1, 0.0, 0.0]


@pytest.mark.parametrize("when", [50, 300, 620])
def test_a_stop_brakes_at_the_limit_on_the_line_and_ends_where_predicted(when):
    motion = LineMotion(0.5, 2.0)
    motion.go([0.3, 0.0, 0.0])
    path = run(motion, 1500, [(when, motion.stop)])
    assert motion.position == motion.rest and not motion.moving
    assert motion.position[0] < 0.3 or when > 600  # where it brakes anyway
    steps = np.diff(path[:, 0])
    assert max(abs(b - a) for a, b in itertools.pairwise(steps)) <= 2.0 * DT * DT * (1 + 1e-6)


def test_a_target_where_it_is_moves_nothing():
    motion = LineMotion(0.5, 2.0)
    assert motion.go([0.0] * 3) and not motion.moving
