"""Joint moments need what they depend on: angles, the pose of the person, and the load under the feet."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from standing_person import JOINTS, RATE, standing, supporting, without

from hric_core.errors import HricError
from hric_human.body import describe
from hric_human.body.segments import link_name
from hric_human.control.whole_body import WholeBody
from hric_motion.moments import JointMoments, joint_force, joint_moments

MOTION = standing()
PLATE = supporting(MOTION)
CUTOFF = 45.0
"""Cut-off that changes hardly anything of these motions without noise [Hz]."""
EDGES = 11
"""Number of instants at both ends of a motion whose moments are not known."""
RESULT = joint_moments(MOTION, RATE, {3: PLATE}, cutoff=CUTOFF)
FOOT, OTHER_FOOT = (WholeBody(MOTION.body).index[link_name("foot", side)] for side in ("right", "left"))


def known(names: list[str], result: JointMoments = RESULT) -> list[bool]:
    inside = result.moment[EDGES:-EDGES]
    return [bool(np.isfinite(inside[:, JOINTS.index(name)]).all()) for name in names]


def test_a_plate_carries_the_whole_person() -> None:
    assert RESULT.standing[link_name("foot", "left")] == (3,) and all(known(JOINTS)) and RESULT.notes == ()


def test_the_residual_counts_where_all_that_may_carry_the_person_is_on_a_plate() -> None:
    assert np.isnan(RESULT.residual_share)  # the slow right foot, which is on no plate, may rest on something
    below = PLATE.T_lab_plate.copy()
    below[:3, 3] += RESULT.needed.position[150, FOOT] - RESULT.needed.position[150, OTHER_FOOT]
    empty = replace(PLATE, T_lab_plate=below, load=0.0 * PLATE.load)
    plates = {3: PLATE, 4: replace(empty, size=(1.0, 1.0))}
    result = joint_moments(MOTION, RATE, plates, cutoff=CUTOFF)
    assert result.residual_share < 0.01 and result.supported[EDGES:-EDGES].all()
    small = plates | {4: replace(empty, size=(0.05, 0.05))}
    assert not joint_moments(MOTION, RATE, small, cutoff=CUTOFF).supported.any()


def test_an_instant_with_a_large_residual_counts() -> None:
    """A plate measures a fifth too little: the residual is a fifth, although the moments of the legs are not known."""
    weak = replace(PLATE, size=(3.0, 3.0), load=0.8 * PLATE.load)
    result = joint_moments(MOTION, RATE, {3: weak}, cutoff=CUTOFF)
    assert result.residual_share == pytest.approx(0.2, abs=0.01) and not known(["left_knee_flex"], result)[0]


def test_a_free_leg_needs_only_its_own_weight() -> None:
    free, bound = (np.nanmean(np.abs(RESULT.moment[:, JOINTS.index(f"{side}_hip_abd")])) for side in ("right", "left"))
    assert free < 0.35 * bound


def test_legs_without_a_plate_are_not_known() -> None:
    result = joint_moments(MOTION, RATE)
    assert known(["left_knee_flex", "right_hip_flex"], result) == [False, False]
    assert all(known([name for name in JOINTS if "sh" in name or "trunk" in name], result))
    assert np.isnan(result.residual_share)


def test_both_feet_on_a_plate_are_not_told_apart() -> None:
    q = MOTION.q.copy()
    q[:, JOINTS.index("left_hip_abd")], q[:, JOINTS.index("right_knee_flex")] = 0.0, 0.0
    together = replace(MOTION, q=q)
    result = joint_moments(together, RATE, {1: supporting(together)})
    assert "force plate 1: it is not known which foot loads it" in result.notes[-1]
    assert known(["left_ankle_flex"], result) == [False]


def test_an_unknown_shoulder_hides_what_depends_on_it() -> None:
    result = joint_moments(without(MOTION, "right_sh_rot"), RATE, {3: PLATE}, cutoff=CUTOFF)
    assert known(["right_el_flex", "right_sh_flex", "trunk_flex"], result) == [False] * 3
    assert known(["left_sh_flex", "neck_flex", "left_knee_flex"], result) == [True] * 3


def test_an_unknown_wrist_hides_only_itself() -> None:
    result = joint_moments(without(MOTION, "right_wr_flex"), RATE, {3: PLATE}, cutoff=CUTOFF)
    assert known(["right_wr_flex", "right_el_flex", "trunk_flex"], result) == [False, True, True]


def test_a_bent_trunk_rests_on_the_pelvis_with_its_weight() -> None:
    q, lean = np.zeros_like(MOTION.q), np.radians(60.0)
    q[:, JOINTS.index("trunk_flex")] = lean
    still = replace(MOTION, q=q, root=np.tile([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0], (len(q), 1)))
    carried = {"torso", "head", "upper_arm", "forearm", "hand"}
    weight = 9.81 * sum(one.mass.mass for one in MOTION.body.segments.values() if one.kind in carried)
    force = joint_force(joint_moments(still, RATE), "trunk_flex")
    assert np.isnan(force[0]).all()
    assert_allclose(force[150], [-weight * np.sin(lean), 0.0, weight * np.cos(lean)], atol=0.5)


def test_the_ends_of_a_motion_have_no_moments() -> None:
    assert np.isnan(RESULT.moment[[0, 9, -10, -1]]).all() and np.isfinite(RESULT.moment[EDGES]).all()


def test_a_person_who_is_hardly_seen_has_no_moments() -> None:
    root = np.full_like(MOTION.root, np.nan)
    root[:10] = MOTION.root[:10]
    with pytest.raises(HricError, match="known in 10 successive frames; valid: 20 or more"):
        joint_moments(replace(MOTION, root=root), RATE)


def test_only_the_longest_known_part_is_used() -> None:
    root = MOTION.root.copy()
    root[100] = np.nan
    result = joint_moments(replace(MOTION, root=root), RATE, {3: PLATE})
    assert result.notes[0] == "only frames 102 to 300 are used: in others the pose is not known"
    assert result.motion.time[0] == pytest.approx(1.01)


def spread(degrees: float, **about: float) -> JointMoments:
    """Return the moments of a person at rest with the forearm forward, whose right elbow has a standard deviation."""
    q, deviation = np.zeros_like(MOTION.q), np.zeros_like(MOTION.q)
    q[:, JOINTS.index("right_el_flex")] = np.radians(60.0)
    deviation[:, JOINTS.index("right_el_flex")] = np.radians(degrees)
    root = np.tile([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0], (len(q), 1))
    return joint_moments(replace(MOTION, q=q, spread=deviation, root=root), RATE, **about)


def elbow(result: JointMoments) -> tuple[float, float]:
    column = JOINTS.index("right_el_flex")
    return abs(float(result.moment[150, column])), float(result.half_width[150, column])


def test_the_weight_of_a_forearm_is_uncertain_by_mass_and_length() -> None:
    moment, half = elbow(spread(0.0))
    assert_allclose(half, 1.96 * moment * np.hypot(0.02, 0.02), rtol=0.01)
    moment, half = elbow(spread(0.0, mass_deviation=0.15))
    assert_allclose(half, 1.96 * moment * np.hypot(0.15, 0.02), rtol=0.01)


@pytest.mark.parametrize(("mass", "height"), [(30.0, 1.2), (30.0, 2.2), (200.0, 2.2)])
def test_a_subject_at_the_edge_of_the_table_has_moments(mass: float, height: float) -> None:
    motion = standing(describe(replace(MOTION.body.subject, mass=mass, height=height)))
    result = joint_moments(motion, RATE, {3: supporting(motion)}, mass_deviation=0.15)
    assert np.isfinite(result.half_width[EDGES:-EDGES, JOINTS.index("right_el_flex")]).all()


def test_an_uncertain_angle_moves_the_lever_of_the_forearm() -> None:
    """Its moment is proportional to sin 60 deg; 3 deg change it by cos 60 deg times 3 deg."""
    moment, half = elbow(spread(3.0))
    angle = abs(np.sin(np.radians(63.0)) / np.sin(np.radians(60.0)) - 1.0)
    assert_allclose(half, 1.96 * moment * np.sqrt(2 * 0.02**2 + angle**2), rtol=0.01)


def test_intervals_of_moments_hold_those_of_motions_with_errors() -> None:
    """Angles with random constant errors: 95 % of the moments are in the interval, for the trunk and an arm."""
    rng, size = np.random.default_rng(3), np.radians(2.0)
    stated = joint_moments(replace(MOTION, spread=np.full_like(MOTION.q, size)), RATE, {3: PLATE}, cutoff=CUTOFF)
    columns = [JOINTS.index(name) for name in ("trunk_flex", "right_sh_flex", "right_el_flex")]
    inside = []
    for _ in range(150):
        moved = replace(MOTION, q=MOTION.q + rng.normal(scale=size, size=len(JOINTS)))
        change = joint_moments(moved, RATE, cutoff=CUTOFF).moment - stated.moment
        inside.append(np.abs(change[[100, 200]][:, columns]) <= stated.half_width[[100, 200]][:, columns])
    assert 0.9 < np.mean(inside) < 0.995
    assert np.isnan(stated.half_width[0]).all()


def test_an_unknown_moment_has_no_interval() -> None:
    result = joint_moments(without(MOTION, "right_sh_rot"), RATE, {3: PLATE}, cutoff=CUTOFF)
    assert np.isnan(result.half_width[:, JOINTS.index("trunk_flex")]).all()
