"""Force and work of a grip, and what it loads on a person's links, beside closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from hric_assessment.ergonomics.effort import effort
from hric_assessment.ergonomics.muscle_load import grip_loads, load_of, motion_of
from hric_bags.records.human_record import GripRecord, HumanRecord
from hric_bags.records.root_record import RootRecord
from hric_core.errors import HricError
from hric_core.geometry import Pose
from hric_human.body import describe
from hric_human.control.whole_body import ExternalLoad
from hric_human.muscles.choose import find
from hric_human.participant.settings import HumanSettings, MuscleSettings

TIME = np.arange(0.0, 4.0005, 0.001)
CLOSED = (TIME > 0.9995) & (TIME < 3.0005)


def grip() -> GripRecord:
    """From 1 s to 3 s a force of 6 to 10 N, largest at 2 s; the hand goes 0.5 m against it and 0.25 m back."""
    size = CLOSED * (10.0 - 4.0 * np.abs(TIME - 2.0))
    along = np.interp(TIME, [1.0, 2.0, 3.0], [0.0, 0.5, 0.25])
    point = np.column_stack([along, 0.0 * TIME + 0.2, 0.0 * TIME + 1.0])
    torque = np.outer(CLOSED * (TIME - 1.0), [0.0, 1.2, 1.6])
    force = np.outer(size, [-0.6, 0.0, 0.8])
    return GripRecord("right", "box::handle", "human::r_wrist", TIME, CLOSED, force, torque, point, 0.0 * TIME)


def test_force_and_work_of_a_grip_are_those_of_its_closed_form() -> None:
    found = effort(grip())
    assert found is not None
    assert (found.closed, found.force_mean) == (pytest.approx(2.0, abs=2e-3), pytest.approx(8.0, rel=1e-3))
    assert (found.force_max, found.force_max_time) == (pytest.approx(10.0), pytest.approx(2.0))
    assert found.torque_max == pytest.approx(4.0)
    assert found.work == pytest.approx(0.6 * 8.0 * (0.5 - 0.25), rel=5e-3)
    assert found.work_absolute == pytest.approx(0.6 * 8.0 * (0.5 + 0.25), rel=5e-3)


def test_a_grip_is_closed_for_its_share_of_the_messages() -> None:
    rows = slice(0, 5)
    closed = np.array([False, True, True, True, False])
    few = {name: getattr(grip(), name)[rows] for name in ("force", "torque", "point")}
    found = effort(replace(grip(), time=np.arange(5.0, 10.0), closed=closed, **few))
    assert found is not None and found.closed == pytest.approx(0.6 * 4.0)


def test_a_grip_that_never_closed_or_has_one_message_has_no_effort() -> None:
    assert effort(replace(grip(), closed=np.zeros(len(TIME), np.bool_))) is None
    one = {name: getattr(grip(), name)[2000:2001] for name in ("time", "closed", "force", "torque", "point")}
    assert effort(replace(grip(), **one)) is None


@pytest.mark.parametrize(
    ("holder", "held", "sign"),
    [("human::r_wrist", "box::handle", 1.0), ("panda::panda_hand", "human::r_wrist", -1.0)],
    ids=["holds", "is held"],
)
def test_a_grip_loads_the_persons_link_between_its_first_message_and_its_last(
    holder: str, held: str, sign: float
) -> None:
    some = grip()
    rows = slice(1500, 2500, 10)
    part = replace(
        some, holder=holder, held=held, time=TIME[rows], force=some.force[rows], torque=some.torque[rows],
        point=some.point[rows], closed=CLOSED[rows],
    )  # fmt: skip
    (load,) = grip_loads([part], np.array([1.0, 1.755, 3.0]))
    assert load.link == "r_wrist"
    np.testing.assert_allclose(load.force, sign * np.outer([0.0, 10.0 - 4.0 * 0.245, 0.0], [-0.6, 0.0, 0.8]), atol=1e-9)
    np.testing.assert_allclose(load.torque, sign * np.outer([0.0, 0.755, 0.0], [0.0, 1.2, 1.6]), atol=1e-9)
    np.testing.assert_allclose(load.point[1], [0.3775, 0.2, 1.0], atol=1e-9)
    assert np.isfinite(load.point).all()


def test_a_grip_between_others_loads_nobody() -> None:
    assert grip_loads([replace(grip(), holder="panda::panda_hand")], TIME) == []


def recorded(names: list[str], q: np.ndarray) -> HumanRecord:
    none = np.zeros((1, len(names)))
    return HumanRecord(tuple(names), np.arange(len(q)) * 0.01, q, np.zeros(1), none, none, {})


def test_the_joints_of_a_motion_are_in_the_order_of_the_body_whatever_that_of_the_record() -> None:
    q = np.tile([0.1, 0.2, 0.3], (200, 1))
    motion, root = motion_of(recorded(["a", "b", "c"], q), ["c", "a"], Pose((0.0, 0.0, 1.0)), 5.0)
    np.testing.assert_allclose(motion.q, np.tile([0.3, 0.1], (len(motion.time), 1)), atol=1e-6)
    assert root == Pose((0.0, 0.0, 1.0))


@pytest.mark.parametrize("walks", [False, True], ids=["stands", "walks"])
def test_the_rate_and_the_cut_off_of_a_motion_are_those_asked_for(walks: bool) -> None:
    """A joint shakes by 0.1 rad ten times a second."""
    pose = np.tile([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], (2, 1))
    shaken = replace(
        recorded(["a"], 0.1 * np.sin(2.0 * np.pi * 10.0 * np.arange(200) * 0.01)[:, None]),
        root=RootRecord(np.array([0.0, 2.0]), pose) if walks else None,
    )
    slow, _ = motion_of(shaken, ["a"], Pose(), 1.0, rate=50.0)
    assert np.diff(slow.time) == pytest.approx(0.02) and np.abs(slow.q[10:-10]).max() < 0.01
    fast, _ = motion_of(shaken, ["a"], Pose(), 40.0, rate=200.0)
    assert np.diff(fast.time) == pytest.approx(0.005) and np.abs(fast.q).max() > 0.08


def test_a_joint_that_is_not_recorded_is_named_with_those_that_are() -> None:
    with pytest.raises(HricError, match="the recorded motion has no joint d; valid: a, b"):
        motion_of(recorded(["a", "b"], np.zeros((200, 2))), ["a", "d"], Pose(), 5.0)


def test_muscles_are_more_active_where_they_are_weaker_and_where_the_hand_carries_a_load() -> None:
    body = describe(HumanSettings.of({"parts": "right_arm"}, "human").person)
    names = list(body.joints)
    raised = [1.0 if name == "right_sh_flex" else 0.5 for name in names]
    motion, root = motion_of(recorded(names, np.tile(raised, (60, 1))), names, Pose(), 5.0)
    anatomy, (n, ones) = find(MuscleSettings().anatomy, "anatomy"), (len(motion.time), np.ones((len(motion.time), 1)))
    box = ExternalLoad("r_wrist", ones * [0.0, 0.0, -10.0], np.zeros((n, 3)), ones * [0.5, -0.2, 0.3])
    plain, weak, loaded = (
        load_of(body, anatomy, root, motion, loads, strength)
        for loads, strength in (((), 1.0), ((), 0.65), ([box], 1.0))
    )
    np.testing.assert_array_equal(load_of(body, anatomy, root, motion).activation, plain.activation)
    assert weak.activation.max() > 1.2 * plain.activation.max()
    assert loaded.activation.max() > 1.2 * plain.activation.max()
