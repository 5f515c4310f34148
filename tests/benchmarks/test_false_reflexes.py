"""False collision reflexes: thresholds that suit an ideal arm stop motions of a realistic arm without contact."""

import pytest
from false_reflexes import emulated_arm, measure, move, targets

MOTIONS, SCALE = 6, 0.07
COLLISIONS = {"joint_reflex", "cartesian_reflex"}


def test_the_same_motions_are_free_of_false_collisions_on_an_ideal_arm_and_not_on_a_measured_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    rates = {name: measure(name, MOTIONS).rate(SCALE) for name in ("ideal", "measured")}
    with capsys.disabled():
        print(f"\nfalse collisions at {SCALE} times the default thresholds: {rates}")
    assert rates["ideal"] == 0.0 and rates["measured"] == 1.0


@pytest.mark.parametrize(("share", "ends"), [(1.01, False), (0.99, True)])
def test_what_the_table_counts_is_what_the_reflexes_do(share: float, ends: bool) -> None:
    scale = share * measure("measured", 1).peaks[0]
    arm = emulated_arm("measured")
    limits = arm.box.config.collision_behavior
    torques, forces = ([scale * x for x in row] for row in (limits.upper_torque_nominal, limits.upper_force_nominal))
    arm.set_collision_behavior(*[torques] * 4, *[forces] * 4)
    errors = move(arm, targets(1)[0])
    arm.close()
    assert bool(errors) == ends and errors <= COLLISIONS
