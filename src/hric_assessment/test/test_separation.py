"""The protective distance, and distances of capsules beside a collision library and a search."""

import math

import coal
import numpy as np
import pytest
from bodies import Posed, body
from scipy.optimize import minimize

from hric_assessment.separation.capsules import Capsules, distances, of_body, segment_distance
from hric_assessment.separation.minima import Separation, separation
from hric_assessment.separation.protective import Stop, intrusion, person_speed, protective_distance
from hric_core.errors import HricError

MARGINS = {"intrusion": 0.2, "person_uncertainty": 0.1, "robot_uncertainty": 0.01}


def test_the_noted_distances_come_out_with_and_without_data_of_the_braking() -> None:
    braking = protective_distance(1.0, 1.6, Stop(0.1, 0.3, constant=True), **MARGINS)
    assert f"{braking.total:.2f}" == "1.20"
    assert tuple(map(float, braking)) == pytest.approx((0.64, 0.1, 0.15, 0.2, 0.1, 0.01))
    assert f"{protective_distance(1.0, 1.6, Stop(0.1, 0.3), **MARGINS).total:.2f}" == "1.35"


def test_a_measured_stopping_distance_takes_the_place_of_the_estimate() -> None:
    assert protective_distance(1.0, 1.6, Stop(0.1, 0.3, 0.07, constant=True), **MARGINS).stopping == 0.07


def test_an_even_stop_takes_the_distance_of_its_falling_speed() -> None:
    """Public code adds a T_s^2/2 to the stopping distance, as if the arm went on speeding up."""
    v, t = 1.3, 0.4
    instants = np.linspace(0.0, t, 10001)
    expected = np.trapezoid(v * (1.0 - instants / t), instants)
    assert float(protective_distance(v, 0.0, Stop(0.0, t, constant=True), 0.0, 0.0, 0.0).total) == pytest.approx(
        expected
    )


def test_no_term_is_left_out_unsaid() -> None:
    """Public code takes T_r, C and Z as 0."""
    with pytest.raises(TypeError, match="reaction_time"):
        Stop(time=0.3)  # type: ignore[call-arg]
    for name in MARGINS:
        with pytest.raises(TypeError, match=name):
            protective_distance(1.0, 1.6, Stop(0.1, 0.3), **{key: 0.1 for key in MARGINS if key != name})


def test_the_person_walks_on_while_the_arm_reacts_and_stops() -> None:
    assert float(protective_distance(1.0, 1.6, Stop(0.1, 0.3), **MARGINS).person) == pytest.approx(1.6 * 0.4)


def test_the_distance_is_computed_for_all_instants_at_once() -> None:
    speeds = np.array([0.0, 0.5, 1.0])
    total = protective_distance(speeds, 1.6, Stop(0.1, 0.3 * speeds), **MARGINS).total
    expected = [float(protective_distance(v, 1.6, Stop(0.1, 0.3 * v), **MARGINS).total) for v in speeds.tolist()]
    assert total.tolist() == expected


def test_arrays_of_any_layout_but_of_one_shape_and_type_are_taken() -> None:
    both, stop = np.array([[0.0, 1.0], [0.5, 2.0]]), Stop(0.1, 0.3)
    for speeds in (both, both[:, 1], both[::-1, 0]):
        total = protective_distance(speeds, 1.6, stop, **MARGINS).total
        assert total == pytest.approx(1.6 * 0.4 + 0.4 * speeds + sum(MARGINS.values()))
    for wrong in (both.T, both[:, :1], both.astype(int)):
        with pytest.raises(ValueError, match="contiguous float64 arrays of one shape"):
            protective_distance(both, wrong, stop, **MARGINS)


def by_the_steps_of_a_manual(time: float, added: float) -> float:
    """S as an operating manual of a light curtain computes it after ISO 13855, in its three steps [m]."""
    near = 2.0 * time + added
    if near <= 0.5:
        return near
    return max(1.6 * time + added, 0.5)


@pytest.mark.parametrize("added", [0.0, 0.05, 0.3, 0.6])
def test_a_person_of_unknown_speed_comes_by_the_speed_that_the_distance_itself_asks_for(added: float) -> None:
    for time in np.linspace(0.0, 0.6, 61).tolist():
        stop = Stop(0.0, time, 0.0)
        speed = person_speed(0.0, stop, added, 0.0, 0.0)
        total = float(protective_distance(0.0, speed, stop, added, 0.0, 0.0).total)
        assert total == pytest.approx(by_the_steps_of_a_manual(time, added))


def test_the_example_of_that_manual_comes_out() -> None:
    """SICK miniTwin4, page 24: T 0.32 s, C 0: S 640 mm with 2 m/s, therefore 512 mm with 1.6 m/s."""
    stop = Stop(0.03, 0.29, 0.0)
    assert person_speed(0.0, stop, 0.0, 0.0, 0.0) == pytest.approx(1.6)
    assert protective_distance(0.0, 1.6, stop, 0.0, 0.0, 0.0).total == pytest.approx(0.512)


@pytest.mark.parametrize(("resolution", "expected"), [(0.0, 0.0), (0.014, 0.0), (0.030, 0.128), (0.040, 0.208)])
def test_the_intrusion_follows_from_the_resolution(resolution: float, expected: float) -> None:
    assert intrusion(resolution) == pytest.approx(expected)


@pytest.mark.parametrize("resolution", [0.041, -0.001, math.nan])
def test_a_resolution_for_which_there_is_no_formula_is_refused(resolution: float) -> None:
    with pytest.raises(HricError, match=r"resolution is .* m; valid: 0 to 0.04 m"):
        intrusion(resolution)


def test_a_negative_term_is_refused_by_name() -> None:
    with pytest.raises(HricError, match=r"stop.time is -0.1; valid: finite numbers of 0 or more"):
        protective_distance(1.0, 1.6, Stop(0.1, -0.1), **MARGINS)


@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
@pytest.mark.parametrize(
    "name", ["robot_speed", "person_speed", "intrusion", "person_uncertainty", "robot_uncertainty"]
)
def test_a_speed_or_a_margin_that_cannot_be_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(HricError, match=f"{name} is {value}; valid: finite numbers of 0 or more"):
        protective_distance(**{"robot_speed": 1.0, "person_speed": 1.6, "stop": Stop(0.1, 0.3), **MARGINS, name: value})


@pytest.mark.parametrize(
    ("stop", "name"),
    [(Stop(-0.1, 0.3), "reaction_time"), (Stop(0.1, math.nan), "time"), (Stop(0.1, 0.3, -0.1), "distance")],
)
def test_a_stop_that_cannot_be_is_refused_by_name(stop: Stop, name: str) -> None:
    with pytest.raises(HricError, match=f"stop.{name} is .*; valid: finite numbers of 0 or more"):
        protective_distance(1.0, 1.6, stop, **MARGINS)


def posed(p: np.ndarray, q: np.ndarray, radius: float) -> tuple[coal.Capsule, coal.Transform3s]:
    """A capsule of coal along a segment."""
    along = q - p
    length = float(np.linalg.norm(along))
    z = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    return coal.Capsule(radius, length), coal.Transform3s(np.column_stack([x, np.cross(z, x), z]), 0.5 * (p + q))


def library_distance(a: np.ndarray, ra: float, b: np.ndarray, rb: float) -> float:
    first, T_first = posed(*a, ra)
    second, T_second = posed(*b, rb)
    request = coal.DistanceRequest()
    request.gjk_tolerance = 1e-9
    return float(coal.distance(first, T_first, second, T_second, request, coal.DistanceResult()))


def pairs(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments at random, and those that closed forms stumble over: parallel, collinear, crossing, touching, points."""
    random = np.random.default_rng(5)
    a, b = random.uniform(-0.5, 0.5, (2, count, 2, 3))
    b += random.uniform(-0.6, 0.6, (count, 1, 3))
    b[::8, 1] = b[::8, 0] + random.uniform(-2, 2, (len(b[::8]), 1)) * (a[::8, 1] - a[::8, 0])  # parallel
    b[1::8, 1] = b[1::8, 0] + a[1::8, 1] - a[1::8, 0] + 1e-9 * random.normal(size=b[1::8, 1].shape)  # nearly so
    b[2::16] = a[2::16] + 1.5 * (a[2::16, 1:] - a[2::16, :1])  # on one line
    b[3::16, 1] = b[3::16, 0]  # a ball
    a[4::16, 1] = a[4::16, 0]
    a[5::16, 1], b[5::16, 1] = a[5::16, 0], b[5::16, 0]  # two balls
    return a, b


def test_distances_of_capsules_are_those_of_a_collision_library() -> None:
    a, b = pairs(800)
    radii = np.array([0.03]), np.array([0.05])
    found = distances(a[:, None], radii[0], b[:, None], radii[1])[:, 0, 0]
    expected = np.array([library_distance(p, 0.03, q, 0.05) for p, q in zip(a, b, strict=True)])
    apart = expected > 0.0
    assert 600 < apart.sum() < 800
    np.testing.assert_allclose(found[apart], expected[apart], atol=1e-6)
    assert np.all(found[~apart] < 1e-6)


def searched(a: np.ndarray, b: np.ndarray) -> float:
    """Smallest distance of two segments by a search from several begins."""

    def square(x: np.ndarray) -> float:
        apart = a[0] + x[0] * (a[1] - a[0]) - b[0] - x[1] * (b[1] - b[0])
        return float(apart @ apart)

    starts = ((0.5, 0.5), (0.0, 1.0), (1.0, 0.0))
    found = [minimize(square, x0, bounds=((0, 1), (0, 1)), method="L-BFGS-B", tol=1e-14) for x0 in starts]
    return math.sqrt(max(0.0, min(one.fun for one in found)))


def test_distances_of_segments_are_those_of_a_search() -> None:
    a, b = pairs(160)
    expected = [searched(p, q) for p, q in zip(a, b, strict=True)]
    np.testing.assert_allclose(segment_distance(a, b), expected, atol=2e-6)


def test_segments_that_cross_have_no_distance_and_the_order_does_not_matter() -> None:
    a, b = np.array([[-1.0, 0, 0], [1, 0, 0]]), np.array([[0, -1.0, 0], [0, 1, 0]])
    assert segment_distance(a, b) == 0.0
    p, q = pairs(400)
    np.testing.assert_allclose(segment_distance(p, q), segment_distance(q, p), atol=1e-8)


@pytest.mark.parametrize("unknown", [np.nan, np.inf])
def test_a_distance_from_an_unknown_position_is_not_known(unknown: float) -> None:
    known = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    lost = np.array([[0.0, unknown, 1.0], [1.0, 0.0, 1.0]])
    assert np.isnan(segment_distance(known, lost)) and np.isnan(segment_distance(lost, known))


def test_the_capsules_of_a_person_are_where_their_links_are() -> None:
    made = body(parts="upper_body")
    capsules = of_body(made)
    angles = {"right_sh_flex": 50.0, "right_el_flex": 40.0, "trunk_flex": 20.0}
    pose = Posed(made, **angles)
    T = np.tile(np.eye(4), (1, len(capsules.links), 1, 1))
    for k, link in enumerate(capsules.links):
        T[0, k, :3, :3], T[0, k, :3, 3] = pose.rotation(link), pose.point(link)
    placed = capsules.placed(T)
    for k, (segment, link) in enumerate(zip(made.segments.values(), capsules.links, strict=True)):
        np.testing.assert_allclose(placed[0, k], [pose.point(link, end) for end in segment.straight], atol=1e-12)
        assert capsules.radii[k] == segment.radius


STILL = Capsules(("a",), np.zeros((1, 2, 3)), np.array([0.05]))


def passing(speed: float, offset: float, at: float):
    """A ball that passes another one at a distance of its path, nearest at a time."""
    return lambda t: np.stack([np.stack([speed * (t - at), 0 * t + offset, 0 * t], -1)] * 2, 1)[:, None]


def still(t: np.ndarray) -> np.ndarray:
    return np.zeros((len(t), 1, 2, 3))


@pytest.mark.parametrize("at", [1.0, 1.0042, 1.0051])
def test_a_minimum_between_two_instants_is_met_within_a_millisecond(at: float) -> None:
    found = separation(0.0, 2.0, still, STILL.radii, passing(2.0, 0.2, at), STILL.radii)
    assert found.closest.time == pytest.approx(at, abs=5.1e-4)
    assert found.closest.distance == pytest.approx(0.1, abs=3e-6)
    assert found.closest == found.minima[0] and len(found.minima) == 1


@pytest.mark.parametrize("at", [5.0042, 6.9958])
def test_a_minimum_beside_an_end_of_a_run_is_met_within_a_millisecond(at: float) -> None:
    found = separation(5.0, 7.0, still, STILL.radii, passing(2.0, 0.2, at), STILL.radii)
    assert found.closest.time == pytest.approx(at, abs=5.1e-4)
    assert (found.time[0], found.time[-1]) == (5.0, 7.0)


@pytest.mark.parametrize("at", [4.0, 8.0])
def test_of_who_goes_away_or_comes_all_the_time_an_end_is_nearest_and_nothing_is_asked_beyond(at: float) -> None:
    found = separation(5.0, 7.0, still, STILL.radii, passing(2.0, 0.2, at), STILL.radii)
    assert [one.time for one in found.minima] == [5.0 if at < 5.0 else 7.0]
    assert (found.time[0], found.time[-1]) == (5.0, 7.0)


@pytest.mark.parametrize(("then", "minima"), [(1.0, 1), (-1.0, 1)], ids=["and goes", "and comes nearer"])
def test_who_waits_while_near_has_one_minimum_or_none_if_they_come_nearer_later(then: float, minima: int) -> None:
    def person(t: np.ndarray) -> np.ndarray:
        apart = 0.5 + np.maximum(0.5 - t, 0.0) + then * np.maximum(t - 1.5, 0.0) * 0.5
        return still(t) + apart[:, None, None, None] * np.array([1.0, 0.0, 0.0])

    found = separation(0.0, 2.0, still, STILL.radii, person, STILL.radii)
    assert len(found.minima) == minima
    assert found.closest.distance == pytest.approx(0.4 if then > 0.0 else 0.15)


def test_half_a_millisecond_has_a_separation() -> None:
    found = separation(0.0, 5e-4, still, STILL.radii, passing(0.0, 0.5, 0.0), STILL.radii)
    assert (found.time.tolist(), found.closest.distance) == ([0.0, 5e-4], pytest.approx(0.4))


def test_instants_are_a_hundredth_apart_and_a_thousandth_around_a_minimum() -> None:
    found = separation(5.0, 7.0, still, STILL.radii, passing(2.0, 0.2, 6.0), STILL.radii)
    steps = np.diff(found.time)
    near = np.abs(found.time[:-1] - 6.0) < 9e-3
    np.testing.assert_allclose(steps[near], 1e-3, rtol=1e-6)
    assert steps.max() == pytest.approx(1e-2)
    assert len(found.time) == 201 + 18


def test_the_nearest_pair_is_named_and_local_minima_are_all_found() -> None:
    def two(t: np.ndarray) -> np.ndarray:
        return np.concatenate([passing(1.0, 0.5, 0.6042)(t), passing(1.0, -0.3, 1.4042)(t)], axis=1)

    found = separation(0.0, 2.0, still, STILL.radii, two, np.array([0.05, 0.05]))
    assert [(one.arm, one.person) for one in found.minima] == [(0, 0), (0, 1)]
    assert [one.time for one in found.minima] == pytest.approx([0.6042, 1.4042], abs=5.1e-4)
    assert [one.distance for one in found.minima] == pytest.approx([0.4, 0.2], abs=1e-6)


def test_the_nearest_of_many_pairs_is_that_of_all() -> None:
    random = np.random.default_rng(4)
    ends, swing = random.uniform(-1.0, 1.0, (2, 16, 2, 3))
    radii = random.uniform(0.02, 0.2, 16)

    def arm(t: np.ndarray) -> np.ndarray:
        return ends[:6] + swing[:6] * np.sin(3.0 * t)[:, None, None, None]

    def person(t: np.ndarray) -> np.ndarray:
        return ends[6:] + swing[6:] * np.cos(2.0 * t)[:, None, None, None]

    found = separation(0.0, 8.0, arm, radii[:6], person, radii[6:])
    gaps = distances(arm(found.time), radii[:6], person(found.time), radii[6:]).reshape(len(found.time), -1)
    nearest = np.stack(np.divmod(gaps.argmin(axis=1), 10))
    np.testing.assert_array_equal(found.distance, gaps.min(axis=1))
    np.testing.assert_array_equal([found.arm, found.person], nearest)


def test_each_violation_is_one_of_its_own() -> None:
    def again(t: np.ndarray) -> np.ndarray:
        return passing(1.0, 0.3, 0.5)(t % 1.0)

    found = separation(0.0, 2.0, still, STILL.radii, again, STILL.radii)
    assert [one.time for one in found.violations(0.25)] == pytest.approx([0.5, 1.5], abs=1e-3)


def test_a_separation_that_does_not_change_has_one_minimum() -> None:
    found = separation(0.0, 1.0, still, STILL.radii, passing(0.0, 0.5, 0.0), STILL.radii)
    assert [one.distance for one in found.minima] == pytest.approx([0.4])


def test_violations_are_where_the_separation_is_below_the_protective_distance() -> None:
    found = separation(0.0, 2.0, still, STILL.radii, passing(2.0, 0.2, 1.0), STILL.radii)
    (one,) = found.violations(0.2)
    half = math.sqrt(0.3**2 - 0.2**2) / 2.0
    assert (one.begin, one.end) == pytest.approx((1.0 - half, 1.0 + half), abs=1e-2)
    assert (one.time, one.margin) == pytest.approx((1.0, -0.1))
    assert found.violations(0.05) == []
    assert len(found.violations(np.where(found.time < 1.0, 0.2, 0.05))) == 1


def test_a_violation_ends_where_the_protective_distance_is_reached() -> None:
    distance, none = np.array([0.3, 0.1, 0.2, 0.1, 0.1, 0.3]), np.zeros(6, np.int64)
    found = Separation(np.arange(6.0), distance, none, none, ())
    assert [(one.begin, one.end) for one in found.violations(0.2)] == [(1.0, 1.0), (3.0, 4.0)]


def test_a_place_that_is_not_finite_is_refused_with_its_time() -> None:
    def lost(t: np.ndarray) -> np.ndarray:
        return np.where((t > 0.5)[:, None, None, None], math.nan, still(t))

    with pytest.raises(HricError, match=r"a position of arm or person is not finite at 0.510 s"):
        separation(0.0, 1.0, still, STILL.radii, lost, STILL.radii)
    with pytest.raises(HricError, match=r"separation is requested from 1\.0 to 1\.0 s"):
        separation(1.0, 1.0, still, STILL.radii, still, STILL.radii)
