"""The load of a person's muscles while they move: joint torque by pinocchio, the rest by what comes after a run."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from bodies import body, subject
from numpy.testing import assert_allclose
from walking_person import Mover

from hric_core.errors import HricError
from hric_core.geometry import Pose, transformed
from hric_human.body import Body, describe
from hric_human.control.kinematics import HandChain
from hric_human.control.whole_body import ExternalLoad
from hric_human.muscles.after_run import AfterRun, smoothed
from hric_human.muscles.anatomy import BUILT_IN, load
from hric_human.muscles.muscle_set import MuscleSet
from hric_motion.live_load import AWAY, MISSING, REACH, UNMEASURED, WINDOW, HandForce, LiveLoad, PersonLoad
from hric_motion.tracking import BRIDGED, LOST, MEASURED, PersonEstimate, PersonTracker, calibrate

Figure = Callable[[str, float, str], None]
RATE = 60.0
BODY, ANATOMY = body(parts="upper_body"), load(BUILT_IN)
JOINTS, NAMES = list(BODY.joints), list(BODY.markers)
IN_RANGE = {
    f"{side}_{joint}": (low + 0.1, high - 0.1)
    for side in ("right", "left")
    for joint, low, high in zip(ANATOMY.joints, ANATOMY.lower, ANATOMY.upper, strict=True)
}
ROOT = Pose((0.4, -0.2, 1.0), (0.0, 0.0, 0.6, 0.8))
HAND = HandChain(BODY, "right")
MOVER = Mover(BODY, 3.0, within=IN_RANGE)


def estimate(when: float, q: Sequence[float], root: Pose = ROOT, **changes: object) -> PersonEstimate:
    n = len(JOINTS)
    one = PersonEstimate(when, root, list(q), [0.0] * n, MEASURED, [MEASURED] * n, 1e-3, ())
    return one._replace(**changes)


def force_at(when: float, point: np.ndarray) -> HandForce:
    """Return the force of a robot that is guided by hand: some 20 N, and a torque."""
    s, c = np.sin(2.0 * when), np.cos(1.5 * when)
    x, y, z = point.tolist()
    return HandForce(when, (12.0 * s, 15.0 * c, -20.0 + 5.0 * s), (0.5 * c, 0.3 * s, -0.4 * c), (x, y, z))


def grasped(when: float) -> np.ndarray:
    """Return the point where the hand holds the robot, in the world [m]."""
    MOVER.place(when)
    return MOVER.point(BODY.segments["right_hand"].link, np.array([0.05, 0.0, -0.1]))


def fed(
    live: LiveLoad, estimates: Iterable[PersonEstimate], forces: Iterable[HandForce] = (), every: int = 1
) -> list[PersonLoad]:
    """Feed frames and forces in order of time; take results after every given number of frames."""
    found, frames = [], 0
    for one in sorted([*estimates, *forces], key=lambda one: one.time):
        if isinstance(one, HandForce):
            live.add_force(one)
            continue
        live.add(one)
        frames += 1
        if frames % every == 0 and (new := live.take()) is not None:
            found.append(new)
    return found


def joined(found: list[PersonLoad], part: Callable[[PersonLoad], np.ndarray]) -> np.ndarray:
    return np.concatenate([part(one) for one in found])


def test_joint_torque_of_somebody_who_sways_and_pushes_is_that_of_an_independent_library(figure: Figure) -> None:
    """The input is markers with 0.5 mm of noise, and a force sampled at 30 Hz, like the robot's state."""
    tracker, noise = PersonTracker(BODY, NAMES), np.random.default_rng(3)
    times = np.arange(0.0, 4.0, 1.0 / RATE)
    frames = [MOVER.markers(when) for when in times]
    tracked = [
        tracker.update(when, p + noise.normal(0.0, 5e-4, p.shape)) for when, p in zip(times, frames, strict=True)
    ]
    live = LiveLoad(BODY, ANATOMY, "right")
    forces = [force_at(when, grasped(when)) for when in np.arange(0.0, 4.0, 1.0 / 30.0)]
    began = time.process_time()
    found = fed(live, [one for one in tracked if one is not None], forces, every=5)
    figure("person, load of their muscles: share of a processor", (time.process_time() - began) / 4.0, "1")
    when, torque = joined(found, lambda one: one.load.time), joined(found, lambda one: one.load.torque)
    assert np.diff(when) == pytest.approx(0.01) and len(when) > 365
    columns = [JOINTS.index(name) for name in found[0].load.joints]
    expected = []
    for t in when:
        _, force, moment, point = force_at(t, grasped(t))
        arrays = (np.array(one) for one in (force, moment, point))
        expected.append(MOVER.torque(t, BODY.segments["right_hand"].link, *arrays)[columns])
    off = np.abs(torque - np.array(expected))
    figure("person, joint torque against pinocchio: rms of the worst joint", np.sqrt((off**2).mean(0)).max(), "N m")
    figure("person, joint torque against pinocchio: largest", off.max(), "N m")
    assert np.sqrt((off**2).mean(axis=0)).max() < 0.1 and off.max() < 0.3
    assert {state for one in found for states in one.states.values() for state in states} == {MEASURED}
    assert {state for one in found for state in one.force} == {MEASURED}


def torque_errors(known: Body, mover: Mover, offsets: dict[str, np.ndarray]) -> np.ndarray:
    """Return the torque errors for a person with empty hands, tracked with the body `known`, (n, joints) [N m]."""
    tracker, noise, live = PersonTracker(known, NAMES), np.random.default_rng(3), LiveLoad(known, ANATOMY, None)
    for when in np.arange(0.0, 3.0, 1.0 / RATE):
        p = mover.markers(when, offsets)
        one = tracker.update(when, p + noise.normal(0.0, 5e-4, p.shape))
        assert one is not None
        live.add(one)
    found = live.take()
    assert found is not None
    columns, none = [JOINTS.index(name) for name in found.load.joints], np.zeros(3)
    needed = [mover.torque(when, "r_wrist", none, none, none)[columns] for when in found.load.time.tolist()]
    return np.asarray(found.load.torque - np.array(needed))


def test_a_body_that_is_too_small_and_markers_that_are_off_show_in_the_torque_less_when_calibrated(
    figure: Figure,
) -> None:
    random, known = np.random.default_rng(0), subject(parts="upper_body")
    directions = random.normal(size=(len(NAMES), 3))
    offsets = dict(zip(NAMES, 0.01 * directions / np.linalg.norm(directions, axis=1)[:, None], strict=True))
    mover = Mover(describe(replace(known, height=1.03 * known.height)), 3.0, within=IN_RANGE)
    off = np.abs(random.normal(0.0, np.radians(3.0), len(JOINTS)))
    fitted = calibrate(known, NAMES, mover.markers(0.0, offsets, off), {})
    rms = {}
    for name, one in (("not calibrated", BODY), ("calibrated", fitted.body)):
        errors = torque_errors(one, mover, offsets)
        rms[name] = np.sqrt((errors**2).mean(axis=0)).max()
        figure(f"person 3 % taller, markers 10 mm off, {name}: joint torque, rms of the worst joint", rms[name], "N m")
    assert rms["calibrated"] < 0.7 * rms["not calibrated"]


def test_the_load_while_the_person_moves_is_that_after_the_run(figure: Figure) -> None:
    times = np.arange(0.0, 4.0, 1.0 / RATE)
    q = np.array([MOVER.joints(when)[0] for when in times])
    forces = [
        force_at(when, np.array(transformed(ROOT, HAND.pose(row.tolist()).position)))
        for when, row in zip(times, q, strict=True)
    ]
    found = fed(
        LiveLoad(BODY, ANATOMY, "right"), [estimate(*one) for one in zip(times, q.tolist(), strict=True)], forces
    )
    motion = smoothed(times, q)
    acting = [
        np.stack([np.interp(motion.time, times, column) for column in np.array(rows).T], axis=1)
        for rows in zip(*[one[1:] for one in forces], strict=True)
    ]
    after = AfterRun(BODY, MuscleSet(BODY, ANATOMY), ANATOMY, ROOT).of(motion, [ExternalLoad("r_wrist", *acting)])
    when = joined(found, lambda one: one.load.time)
    inside = (when > 0.3) & (when < 3.7)
    rows = np.round(when[inside] / 0.01).astype(int)
    assert_allclose(motion.time[rows], when[inside], atol=1e-9)
    off = {
        name: np.sqrt(
            np.nanmean((joined(found, part)[inside] - part(PersonLoad(after, {}, (), *acting[:2]))[rows]) ** 2)
        )
        for name, part in (
            ("activation", lambda one: one.load.activation),
            ("torque", lambda one: one.load.torque),
            ("contact", lambda one: one.load.contact["right_shoulder"]),
        )
    }
    assert np.isfinite(joined(found, lambda one: one.load.activation)).all()
    figure("person, live load against that after the run: activation, rms", off["activation"], "1")
    figure("person, live load against that after the run: joint torque, rms", off["torque"], "N m")
    assert off["activation"] < 2e-3 and off["torque"] < 0.02 and off["contact"] < 5.0


HELD = [float(np.mean(IN_RANGE.get(name, (0.0, 0.0)))) for name in JOINTS]
TIMES = np.arange(0.0, 2.0, 1.0 / RATE)
PALM = np.array(transformed(ROOT, HAND.pose(HELD).position))


def held(**changes: object) -> list[PersonEstimate]:
    return [estimate(when, HELD, **changes) for when in TIMES]


def pressed(begin: float = 0.0, end: float = 2.0, aside: float = 0.0) -> list[HandForce]:
    point = PALM + np.array([0.0, 0.0, aside])
    return [force_at(when, point) for when in np.arange(begin, end, 1.0 / 30.0)]


def test_portions_make_no_difference() -> None:
    q = [MOVER.joints(when)[0].tolist() for when in TIMES]
    frames = [estimate(when, row) for when, row in zip(TIMES, q, strict=True)]
    one, other = (fed(LiveLoad(BODY, ANATOMY, "right"), frames, pressed(), every) for every in (1, 20))
    for part in (lambda one: one.load.activation, lambda one: one.load.torque, lambda one: one.acting.force):
        first, second = joined(one, part), joined(other, part)
        assert_allclose(first[: len(second)], second, rtol=1e-12, atol=1e-12)


def test_a_force_on_one_hand_loads_that_arm_alone() -> None:
    empty = fed(LiveLoad(BODY, ANATOMY, None), held())[-1]
    (full,) = fed(LiveLoad(BODY, ANATOMY, "right"), held(), pressed(), len(TIMES))
    assert set(empty.force) == {UNMEASURED} and np.isnan(empty.distance).all()
    assert set(full.force) == {MEASURED} and full.distance.max() < 1e-6
    changed = np.abs(full.load.torque[-1] - empty.load.torque[-1])
    arm = np.array([name.startswith("right") for name in full.load.joints])
    assert changed[~arm].max() < 1e-9 and changed[arm].max() > 1.0
    assert_allclose(full.acting.force[:, 2], [force_at(when, PALM).force[2] for when in full.load.time], atol=0.05)


def test_the_load_of_an_arm_is_bridged_and_lost_with_its_joints() -> None:
    """A window with a bridged frame is flagged: joints bridged for 0.2 s flag 0.2 s and half a window on each side."""
    elbow = JOINTS.index("right_el_flex")

    def states(when: float) -> list[str]:
        known = [MEASURED] * len(JOINTS)
        known[elbow] = BRIDGED if 0.5 <= when < 0.7 else LOST if 0.7 <= when < 1.0 else MEASURED
        return known

    frames = [one._replace(states=states(one.time)) for one in held()]
    found = fed(LiveLoad(BODY, ANATOMY, None), frames)
    when = joined(found, lambda one: one.load.time)
    of = {side: np.concatenate([one.states[side] for one in found]) for side in ("right", "left")}
    expected = np.where((when > 0.7 - WINDOW) & (when < 1.0 + WINDOW - 1.0 / RATE + 1e-6), LOST, MEASURED)
    expected = np.where((when > 0.5 - WINDOW - 1e-6) & (when < 0.7 - WINDOW), BRIDGED, expected)
    assert (of["right"] == expected).mean() > 0.97 and set(of["right"]) == {MEASURED, BRIDGED, LOST}
    assert set(of["left"]) == {MEASURED}
    load, lost = found[0].load, of["right"] == LOST
    right = np.array([name.startswith("right") for name in load.names])
    activation, torque = (
        joined(found, part) for part in (lambda one: one.load.activation, lambda one: one.load.torque)
    )
    assert np.isnan(activation[lost][:, right]).all() and np.isfinite(activation[~lost]).all()
    assert np.isfinite(activation[:, ~right]).all()
    right = np.array([name.startswith("right") for name in load.joints])
    assert np.isnan(torque[lost][:, right]).all() and np.isfinite(torque[~lost]).all()
    contact = joined(found, lambda one: one.load.contact["right_elbow"])
    assert np.isnan(contact[lost]).all() and np.isfinite(contact[~lost]).all()


def test_without_their_root_nothing_is_known() -> None:
    found = fed(LiveLoad(BODY, ANATOMY, None), held(root_state=LOST))
    assert all(set(states) == {LOST} for one in found for states in one.states.values())
    assert np.isnan(joined(found, lambda one: one.load.torque)).all()


def test_a_posture_outside_the_fitted_range_has_torque_and_no_muscles() -> None:
    q = list(HELD)
    q[JOINTS.index("left_el_flex")] = 0.0
    found = fed(LiveLoad(BODY, ANATOMY, None), [estimate(when, q) for when in TIMES])[-1]
    assert found.load.outside["left"].all() and not found.load.outside["right"].any()
    left = np.array([name.startswith("left") for name in found.load.names])
    assert np.isnan(found.load.activation[:, left]).all() and np.isfinite(found.load.activation[:, ~left]).all()
    assert np.isfinite(found.load.torque).all() and set(found.states["left"]) == {MEASURED}
    assert np.isnan(found.load.contact["left_shoulder"]).all()


def test_an_arm_whose_force_does_not_come_is_lost_and_waits_for_it_no_longer_than_said() -> None:
    found = fed(LiveLoad(BODY, ANATOMY, "right"), held(), pressed(end=1.0))
    when = joined(found, lambda one: one.load.time)
    force = np.concatenate([one.force for one in found])
    assert set(force[when < 0.95]) == {MEASURED} and set(force[when > 1.0]) == {MISSING}
    assert set(np.concatenate([one.states["right"] for one in found])[when > 1.0]) == {LOST}
    assert set(np.concatenate([one.states["left"] for one in found])) == {MEASURED}
    assert when[-1] > TIMES[-1] - WINDOW - 0.3 - 2.0 / RATE
    assert np.isnan(joined(found, lambda one: one.acting.force)[when > 1.0]).all()


def test_a_sample_of_the_force_that_is_not_finite_is_none() -> None:
    broken = [one._replace(torque=(np.nan, 0.0, 0.0)) if 0.9 < one.time < 1.2 else one for one in pressed()]
    found = fed(LiveLoad(BODY, ANATOMY, "right"), held(), broken)
    when, force = joined(found, lambda one: one.load.time), np.concatenate([one.force for one in found])
    assert set(force[when < 0.85]) == set(force[(when > 1.25) & (when < 1.8)]) == {MEASURED}
    assert set(force[(when > 0.95) & (when < 1.15)]) == {MISSING}


def test_a_force_that_comes_late_is_waited_for() -> None:
    live = LiveLoad(BODY, ANATOMY, "right")
    for one in held():
        live.add(one)
        for force in pressed(one.time - 0.2 - 1.0 / RATE, one.time - 0.2):
            live.add_force(force)
        found = live.take()
    assert found is not None and set(found.force) == {MEASURED}


def test_a_force_far_from_the_hand_is_not_on_it() -> None:
    far = fed(LiveLoad(BODY, ANATOMY, "right"), held(), pressed(aside=REACH + 0.01))[-1]
    empty = fed(LiveLoad(BODY, ANATOMY, None), held())[-1]
    assert set(far.force) == {AWAY} and far.distance[-1] == pytest.approx(REACH + 0.01, abs=1e-6)
    assert not far.acting.force.any()
    assert_allclose(far.load.torque[-1], empty.load.torque[-1], atol=1e-9)


def test_frames_that_are_too_few_or_too_far_apart_give_nothing() -> None:
    live = LiveLoad(BODY, ANATOMY, None)
    frames = [one for one in held() if not 0.8 < one.time < 1.2]
    when = joined(fed(live, frames), lambda one: one.load.time)
    assert len(when) > 50 and not ((when > 0.81) & (when < 1.19)).any()
    assert when.max() > 1.5
    slow = [estimate(when, HELD) for when in np.arange(0.0, 4.0, 0.2)]
    assert fed(LiveLoad(BODY, ANATOMY, None), slow) == []


@pytest.mark.parametrize("later", [-1.0, 1e9])
def test_another_clock_begins_again(later: float) -> None:
    live = LiveLoad(BODY, ANATOMY, "right")
    fed(live, held(), pressed())
    frames, forces = ([one._replace(time=one.time + later) for one in some] for some in (held(), pressed()))
    found = fed(live, frames, forces)
    assert joined(found, lambda one: one.load.time)[0] == pytest.approx(later + WINDOW, abs=0.011)
    assert set(np.concatenate([one.force for one in found])) == {MEASURED}


def test_a_hand_that_the_body_has_not_is_refused() -> None:
    with pytest.raises(HricError, match="has no left hand; valid: right"):
        LiveLoad(body(parts="right_arm"), ANATOMY, "left")
