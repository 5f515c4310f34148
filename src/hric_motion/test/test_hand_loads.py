"""Loads on the hands: moments of a lifted object and of a handle by closed forms, and options that are refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from standing_person import FRAMES, JOINTS, RATE, plate, standing

from hric_core.errors import HricError
from hric_core.trial.c3d import Trial
from hric_core.trial.plates import TrialPlate
from hric_human.control.whole_body import WholeBody
from hric_motion.hand_loads import HandLoad, hand_load, loaded_moments
from hric_motion.measured import MeasuredMotion
from hric_motion.moments import NORMAL, JointMoments

G, MASS = 9.81, 6.0
MIDDLE = 150
"""Frame, and instant of the result, in the middle of the motion."""


def still(elbow: float = 90.0, spread: float = 0.0) -> MeasuredMotion:
    """Return a person who stands upright with a bent right elbow; elbow: [deg], spread: of this angle [rad]."""
    motion = standing()
    q, deviation, column = np.zeros_like(motion.q), np.zeros_like(motion.q), JOINTS.index("right_el_flex")
    q[:, column], deviation[:, column] = np.radians(elbow), spread
    root = np.tile([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0], (FRAMES, 1))
    return replace(motion, q=q, spread=deviation, root=root)


def trial(plates: dict[int, TrialPlate] | None = None, start: float = 0.0) -> Trial:
    nothing = np.zeros((0, 0))
    return Trial("x.c3d", RATE, (), nothing, 0.0, (), (), nothing, plates or {}, "z", start=start)


def of(result: JointMoments, joint: str, at: int = MIDDLE) -> float:
    return float(result.moment[at, JOINTS.index(joint)])


def change(joint: str, load: HandLoad, at: int = MIDDLE) -> float:
    """Return the change of a moment by a load [N m]."""
    return of(loaded_moments(still(), trial(), load), joint, at) - of(loaded_moments(still(), trial()), joint, at)


def reach(joint: str) -> float:
    """Return how far the hand's centre of mass is in front of a joint of the right arm, by the lengths [m]."""
    body = still().body
    hand = -float(body.segments["right_hand"].mass.com[2])
    return hand if joint == "right_wr_dev" else body.segments["right_forearm"].length + hand


@pytest.mark.parametrize("joint", ["right_sh_flex", "right_el_flex", "right_wr_dev"])
def test_a_lifted_mass_bends_the_arm_by_its_weight_and_lever(joint: str) -> None:
    assert reach(joint) > 0.05
    assert abs(change(joint, HandLoad(("right",), MASS))) == pytest.approx(MASS * G * reach(joint), rel=1e-3)


def test_the_waist_carries_the_lifted_mass_in_front_of_it() -> None:
    waist = float(still().body.segments["torso"].p_parent_link[0])
    shoulder = float(still().body.segments["right_upper_arm"].p_parent_link[0])
    lever = reach("right_el_flex") + shoulder
    assert waist == 0.0
    assert abs(change("trunk_flex", HandLoad(("right",), MASS))) == pytest.approx(MASS * G * lever, rel=1e-3)


def test_both_hands_carry_a_half_each() -> None:
    both, one = HandLoad(("right", "left"), MASS), HandLoad(("right",), MASS / 2)
    assert change("right_el_flex", both) == pytest.approx(change("right_el_flex", one), rel=1e-9)
    side = float(still().body.segments["right_upper_arm"].p_parent_link[1])
    assert abs(change("trunk_bend", one)) == pytest.approx(abs(MASS / 2 * G * side), rel=1e-3)
    assert change("trunk_bend", both) == pytest.approx(0.0, abs=1e-6)


def test_an_accelerated_mass_adds_its_inertia() -> None:
    """A root that goes up and down by 2 cm at 0.5 Hz, with an acceleration of 0.2 m/s^2 up at its lowest place."""
    motion, omega = still(), 2.0 * np.pi * 0.5
    root = motion.root.copy()
    root[:, 2] += 0.02 * np.cos(omega * (np.arange(FRAMES) - MIDDLE) / RATE + np.pi)
    swaying = replace(motion, root=root)
    loaded, alone = (loaded_moments(swaying, trial(), load) for load in (HandLoad(("right",), MASS), None))
    expected = MASS * (G + 0.02 * omega**2) * reach("right_el_flex")
    assert abs(of(loaded, "right_el_flex") - of(alone, "right_el_flex")) == pytest.approx(expected, rel=2e-3)


def test_a_mass_loads_only_while_it_is_lifted() -> None:
    lifted = HandLoad(("right",), MASS, begin=101.0, end=102.0)
    result, alone = (loaded_moments(still(), trial(start=100.0), load) for load in (lifted, None))
    column = JOINTS.index("right_el_flex")
    more = np.abs(result.moment[:, column] - alone.moment[:, column])
    inside = (alone.motion.time >= 1.0) & (alone.motion.time <= 2.0)
    assert np.nanmax(more[~inside]) == 0.0 and np.nanmin(more[inside]) > 10.0
    assert result.hands == "6 kg in the right hand from 101 s to 102 s"


def test_the_interval_of_a_moment_has_the_lever_of_the_load() -> None:
    spread, load = np.radians(4.0), HandLoad(("right",), MASS)
    exact, spread_out = (loaded_moments(still(45.0, value), trial(), load) for value in (0.0, spread))
    column = JOINTS.index("right_el_flex")
    added = spread_out.half_width[MIDDLE, column] ** 2 - exact.half_width[MIDDLE, column] ** 2
    moved = loaded_moments(still(45.0 + 4.0), trial(), load)
    expected = NORMAL * abs(of(moved, "right_el_flex") - of(exact, "right_el_flex"))
    assert expected > 1.0 and np.sqrt(added) == pytest.approx(expected, rel=1e-2)


def test_an_unknown_wrist_hides_the_moments_of_a_loaded_arm() -> None:
    motion = still()
    q = motion.q.copy()
    q[:, JOINTS.index("right_wr_flex")] = np.nan
    unseen = replace(motion, q=q)
    assert np.isfinite(of(loaded_moments(unseen, trial()), "right_el_flex"))
    loaded = loaded_moments(unseen, trial(), HandLoad(("right",), MASS))
    assert np.isnan(of(loaded, "right_el_flex")) and np.isfinite(of(loaded, "left_el_flex"))


def hand_at() -> np.ndarray:
    """Return the place of the right hand's centre of mass [m]."""
    alone = loaded_moments(still(), trial())
    hand = alone.body.segments["right_hand"]
    at = WholeBody(alone.body).index[hand.link]
    return np.asarray(alone.needed.position[MIDDLE, at] + alone.needed.rotation[MIDDLE, at] @ hand.mass.com)


def handle(force: tuple[float, float, float], aside: float = 0.0) -> TrialPlate:
    """Return a handle at the right hand, or `aside` [m] of it, that pushes it with a force [N]."""
    T = np.eye(4)
    T[:3, 3] = hand_at()
    T[2, 3] += aside
    about_lab = np.cross(T[:3, 3], force)
    return plate(np.tile([*force, *about_lab], (FRAMES, 1)), RATE, T)


def test_a_handle_loads_the_arm_by_its_force_and_lever() -> None:
    load = HandLoad(("right",), plate=4)
    pushed = loaded_moments(still(), trial({4: handle((0.0, 0.0, -30.0))}), load)
    more = of(pushed, "right_el_flex") - of(loaded_moments(still(), trial()), "right_el_flex")
    assert abs(more) == pytest.approx(30.0 * reach("right_el_flex"), rel=1e-3)
    assert_allclose(pushed.loads[0].force[MIDDLE], [0.0, 0.0, -30.0], atol=1e-6)
    assert pushed.hands == "force plate 4 as a handle in the right hand" and not any(pushed.standing.values())


def test_a_handle_far_from_the_hand_is_refused() -> None:
    far = trial({4: handle((0.0, 0.0, -30.0), aside=-0.6)})
    with pytest.raises(HricError, match=r"force plate 4 is loaded 0.60 m from the right hand; valid .* up to 0.5 m"):
        loaded_moments(still(), far, HandLoad(("right",), plate=4))
    with pytest.raises(HricError, match="no force plate 3; valid: 4"):
        loaded_moments(still(), far, HandLoad(("right",), plate=3))


def test_an_object_that_is_lifted_after_the_motion_is_refused() -> None:
    with pytest.raises(HricError, match=r"lifted from 7 s to inf s; the motion is known from 0 to 2\.99 s"):
        loaded_moments(still(), trial(), HandLoad(("right",), MASS, begin=7.0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("right", None, None), "--hand, --from and --to need a load; valid: with --load KG or --handle PLATE"),
        ((None, None, None, 1.0), "--hand, --from and --to need a load"),
        ((None, 5.0, None), "the load on the hands is not clear; valid: --hand"),
        (("right", 5.0, 1), "valid: --hand, and one of --load KG and --handle PLATE"),
        (("both", None, 1), "both hands hold the handle; valid: right or left"),
        (("right", None, 0), "--handle is 0; valid: the number of a force plate"),
        (("right", None, 1, 0.5), "--handle is 1; valid: .* without --from and --to"),
        (("right", 0.0, None), "the lifted mass is 0 kg; valid: above 0, up to 100 kg"),
        (("right", float("nan"), None), "the lifted mass is nan kg; valid: above 0"),
        (("right", 5.0, None, 2.0, 1.0), "lifted from 2 s to 1 s; valid: a beginning before the end"),
    ],
)
def test_options_that_are_no_load_are_refused(options: tuple[object, ...], message: str) -> None:
    with pytest.raises(HricError, match=message):
        hand_load(*options)  # type: ignore[arg-type]
