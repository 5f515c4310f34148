"""Senses and strength limits around a human's controller, the built-in controller, and a controller of a user."""

import itertools
import math
import re
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from bodies import body
from cost_ratio import cost_ratio
from numpy.testing import assert_allclose

from hric_core import plugins
from hric_core.errors import HricError, ParameterError
from hric_core.geometry import Pose, Vector
from hric_human.body import Body
from hric_human.control import HumanControl, HumanController, OutOfReachError, Person, Senses
from hric_human.control.impedance import CROSS, STIFFNESS
from hric_human.control.kinematics import own_weight
from hric_human.control.strength import MASS_EXPONENT, MEAN_MASS, STRENGTH, hand_force, strength

ARM = body(parts="right_arm")
REST = HumanControl(ARM, {}, 0).person.rest
ZERO = [0.0] * 7
HAND = HumanControl(ARM, {}, 0).person.hand.pose(REST).position


class Noted(HumanController):
    """Controller that stores what it senses, and returns the torque that the test sets."""

    senses: list[Senses]
    tau: Sequence[float]

    def init(self, person: Person, settings: Any) -> None:
        self.senses, self.tau = [], [0.0] * len(person.joints)

    def update(self, time: float, senses: Senses) -> Sequence[float]:
        self.senses.append(senses)
        return self.tau


@pytest.fixture
def noted(monkeypatch: pytest.MonkeyPatch) -> type[HumanController]:
    monkeypatch.setattr(plugins, "find", lambda base, name: Noted)
    return Noted


def impedance(**parameters: Any) -> dict[str, Any]:
    return {"parameters": parameters}


def moving(k: int) -> tuple[list[float], list[float], Vector]:
    """The true state in a cycle."""
    return [0.1 + 1e-3 * k] * 7, [1.0 + k] * 7, (float(k), 0.0, -float(k))


def test_each_sense_is_late_by_exactly_its_delay(noted: object) -> None:
    human = HumanControl(ARM, {"senses": {"joint_delay": 0.05, "hand_delay": 0.1, "force_delay": 0.003}}, 0)
    for k in range(200):
        human.update(1e-3 * k, *moving(k))
    for k, senses in enumerate(human._controller.senses):  # type: ignore[attr-defined]
        q, dq, _ = moving(max(k - 50, 0))
        assert (list(senses.q), list(senses.dq)) == (q, dq)
        assert senses.force == moving(max(k - 3, 0))[2]
        if k in (0, 99, 100, 101, 199):
            assert senses.hand == human.person.hand.pose(moving(max(k - 100, 0))[0])


def test_a_delay_that_is_no_multiple_of_the_cycle_is_refused() -> None:
    with pytest.raises(ParameterError) as refusal:
        HumanControl(ARM, {"senses": {"joint_delay": 0.0005, "force_delay": 0.0123}}, 0)
    assert str(refusal.value).splitlines() == [
        "human.control.senses.joint_delay is 0.0005; valid: a multiple of the cycle, 0.001 s",
        "human.control.senses.force_delay is 0.0123; valid: a multiple of the cycle, 0.001 s",
    ]


def test_noise_repeats_with_the_seed_differs_between_seeds_and_has_its_deviation(noted: object) -> None:
    content = {
        "senses": {
            "joint_noise": 1e-3,
            "velocity_noise": 1e-2,
            "hand_noise": 2e-3,
            "rotation_noise": 4e-3,
            "force_noise": 0.5,
        }
    }

    def sensed(seed: int) -> np.ndarray:
        human = HumanControl(ARM, content, seed)
        for k in range(2000):
            human.update(1e-3 * k, ZERO, ZERO, (1.0, 2.0, 3.0))
        return np.array(
            [[*s.q, *s.dq, *s.force, *s.hand.position, *s.hand.orientation] for s in human._controller.senses]  # type: ignore[attr-defined]
        )

    first, again, other = sensed(3), sensed(3), sensed(4)
    assert np.array_equal(first, again) and not np.array_equal(first, other)
    assert_allclose(first.std(axis=0)[:20], [1e-3] * 7 + [1e-2] * 7 + [0.5] * 3 + [2e-3] * 3, rtol=0.08)
    assert_allclose(2 * first.std(axis=0)[20:23], 4e-3, rtol=0.08)
    assert_allclose(first[:, :14].mean(axis=0), 0.0, atol=1e-3)


def test_a_torque_beyond_the_strength_is_clipped_and_counted_once_while_it_lasts(noted: object) -> None:
    human = HumanControl(ARM, {}, 0)
    person, controller = human.person, human._controller
    low, high = person.weakest[3], person.strongest[3]
    for torque, expected in ((1e3, high), (1e3, high), (1.0, 1.0), (-1e3, low)):
        controller.tau = [0.0, 0.0, 0.0, torque, 0.0, 0.0, 0.0]  # type: ignore[attr-defined]
        assert human.update(0.0, ZERO, ZERO) == [0.0, 0.0, 0.0, expected, 0.0, 0.0, 0.0]
        assert human.at_strength == [False] * 3 + [abs(torque) > 10.0] + [False] * 3
    assert human.clipped == dict.fromkeys(person.joints, 0) | {"right_el_flex": 2}


@pytest.mark.parametrize(
    ("tau", "text"),
    [
        ([0.0] * 6, "Noted returned 6 values; valid: one for each of right_sh_flex, "),
        ([0.0] * 6 + [float("nan")], "Noted returned nan N m for right_wr_dev at 0.500 s; valid: finite torques"),
    ],
)
def test_what_is_no_torque_is_refused_with_the_joint(noted: object, tau: list[float], text: str) -> None:
    human = HumanControl(ARM, {}, 0)
    human._controller.tau = tau  # type: ignore[attr-defined]
    with pytest.raises(HricError, match=text):
        human.update(0.5, ZERO, ZERO)


def test_strength_goes_with_sex_and_mass_and_each_row_says_its_source() -> None:
    assert all(
        row.source and min(row.positive, row.negative) > 0 and 0.4 < row.women < 0.7 for row in STRENGTH.values()
    )
    assert set(STRENGTH) == set(STIFFNESS) == {joint.row.name for joint in body().joints.values()}
    weak, strong = strength(body(parts="right_arm", mass=MEAN_MASS["male"]))
    row = STRENGTH["el_flex"]
    assert (weak[3], strong[3]) == (-row.negative, row.positive)
    weak, strong = strength(body("P50_female", parts="right_arm", mass=2 * MEAN_MASS["female"]))
    share = 2**MASS_EXPONENT * row.women
    assert (weak[3], strong[3]) == pytest.approx((-share * row.negative, share * row.positive))


def test_largest_hand_force_loads_one_joint_to_its_strength() -> None:
    person = HumanControl(ARM, {}, 0).person
    q, direction = list(person.rest), (0.0, 0.0, 1.0)
    force = hand_force(person, q, direction)
    chain = person.hand.posed(q)
    columns = np.array(chain.velocities(chain.point(person.hand.p_link_hand)))
    tau = np.array(person.own_weight(q)) + columns @ np.multiply(force, direction)
    shares = np.maximum(tau / person.strongest, tau / person.weakest)
    assert shares.max() == pytest.approx(1.0)


class Simulated:
    """A body by pinocchio's forward dynamics, stepped semi-implicitly; joint damping: none."""

    def __init__(self, body: Body, q: Sequence[float]) -> None:
        self.model = pinocchio.buildModelFromXML(body.urdf)
        self.data = self.model.createData()
        self.order = [self.model.joints[self.model.getJointId(name)].idx_q for name in body.joints]
        self._q, self._dq = np.zeros(self.model.nq), np.zeros(self.model.nv)
        self._q[self.order] = q

    @property
    def state(self) -> tuple[list[float], list[float]]:
        return self._q[self.order].tolist(), self._dq[self.order].tolist()

    def step(self, tau: Sequence[float], dt: float = 1e-3) -> None:
        own = np.zeros(self.model.nv)
        own[self.order] = tau
        self._dq += dt * pinocchio.aba(self.model, self.data, self._q, self._dq, own)
        self._q += dt * self._dq


@pytest.mark.parametrize("parts", ["right_arm", "upper_body"])
def test_a_body_at_rest_holds_its_own_weight_and_stays(parts: str) -> None:
    one = body(parts=parts)
    human = HumanControl(one, {}, 0)
    simulated = Simulated(one, human.person.rest)
    for k in range(1000):
        simulated.step(human.update(1e-3 * k, *simulated.state))
    assert_allclose(simulated.state[0], human.person.rest, atol=1e-9)
    assert not any(human.clipped.values())


def test_the_law_is_that_of_a_spring_a_damper_and_the_own_weight() -> None:
    human = HumanControl(ARM, impedance(stiffness=10.0, damping=[1, 2, 3, 4, 5, 6, 7]), 0)
    q, dq = [a + 0.01 for a in REST], [0.1] * 7
    held = human.person.own_weight(q)
    assert human.update(0.0, q, dq) == pytest.approx([-10.0 * 0.01 - 0.1 * (k + 1) + g for k, g in enumerate(held)])


def stiffness_of(posture: Sequence[float]) -> np.ndarray:
    """Return the stiffness of the default law at a posture that is held, without the weight, shape (7, 7) [N m/rad]."""
    points = {"program": "joints", "points": [{"time": 0.0, **dict(zip(ARM.joints, posture, strict=True))}]}
    person = HumanControl(ARM, {}, 0).person
    columns = []
    for joint in range(7):
        q = list(posture)
        q[joint] += 0.01
        tau = HumanControl(ARM, impedance(reference=points), 0).update(0.0, q, ZERO)
        columns.append(np.subtract(person.own_weight(q), tau) / 0.01)
    return np.transpose(columns)


def test_published_stiffness_of_joints_grows_with_their_weight() -> None:
    rows = [STIFFNESS[joint.row.name] for joint in ARM.joints.values()]
    held = [[REST[k] + 0.01 * (k == joint) for k in range(7)] for joint in range(7)]
    weights = [abs(HumanControl(ARM, {}, 0).person.own_weight(q)[joint]) for joint, q in enumerate(held)]
    expected = [row.relaxed + row.growth * weight for row, weight in zip(rows, weights, strict=True)]
    assert np.diag(stiffness_of(REST)) == pytest.approx(expected)


@pytest.mark.parametrize(("rotation", "coupled"), [(0.0, 0), (-math.pi / 2, 1)])
def test_elbow_couples_to_the_shoulder_about_its_axis(rotation: float, coupled: int) -> None:
    K = stiffness_of([0.0, 0.0, rotation, 1.4, 0.0, 0.0, 0.0])
    assert K[coupled, 3] > CROSS.relaxed
    assert K[1 - coupled, 3] == pytest.approx(0.0, abs=1e-9)


def test_coupled_stiffness_is_positive_in_any_posture() -> None:
    low, high = np.transpose([joint.range for joint in ARM.joints.values()])
    drawn = np.random.default_rng(0).uniform(low, high, (20, 7))
    for posture in np.minimum(drawn, high - 0.02).tolist():
        K = stiffness_of(posture)
        assert np.linalg.eigvalsh(0.5 * (K + K.T)).min() > 0.0


def swing_after(delay: float, reflex: float) -> list[float]:
    """Largest angle from rest in each ms of 4 s of an arm alone that was displaced by 0.02 rad; ends where it leaves
    1 rad."""
    human = HumanControl(ARM, {"senses": {"joint_delay": delay}} | impedance(reflex=reflex), 0)
    simulated, found = Simulated(ARM, [a + 0.02 for a in REST]), [0.0]
    while len(found) < 4000 and found[-1] < 1.0:
        simulated.step(human.update(1e-3 * len(found), *simulated.state))
        found.append(float(np.abs(np.subtract(simulated.state[0], REST)).max()))
    return found


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.1, 0.15])
def test_an_arm_alone_comes_back_with_late_reflexes_of_the_default_share(delay: float) -> None:
    assert max(swing_after(delay, 0.25)[-500:]) < 0.002


@pytest.mark.parametrize(("delay", "reflex"), [(0.1, 0.5), (0.02, 1.0)])
def test_an_arm_alone_is_unstable_where_too_much_of_its_impedance_is_late(delay: float, reflex: float) -> None:
    assert max(swing_after(delay, reflex)) > 0.3


def test_stiffness_acts_at_once_but_for_the_share_of_reflexes() -> None:
    law = impedance(stiffness=10.0, damping=0.0, reflex=0.25)
    human = HumanControl(ARM, {"senses": {"joint_delay": 0.002}} | law, 0)
    human.update(0.0, REST, ZERO)
    held = human.person.own_weight(REST)
    q = [a + 0.01 for a in REST]
    torques = [human.update(1e-3 * k, q, ZERO)[3] for k in (1, 2, 3)]
    assert torques[:2] == pytest.approx([held[3] - 0.75 * 0.1] * 2)
    assert torques[2] == pytest.approx(human.person.own_weight(q)[3] - 0.1)


def test_joints_go_from_point_to_point_with_least_jerk() -> None:
    points = [{"time": 0.5, "right_el_flex": 1.0}, {"time": 1.5, "right_el_flex": 1.8, "right_sh_rot": 0.2}]
    human = HumanControl(ARM, impedance(reference={"program": "joints", "points": points}), 0)
    reference = human._controller._reference  # type: ignore[attr-defined]
    assert reference.at(5.0)[0][3] == 1.0
    human.start(2.0)
    time = np.arange(2.0, 4.0, 1e-3)
    q, dq = np.array([reference.at(t) for t in time]).transpose(1, 0, 2)
    assert dq[:, 3].max() == pytest.approx(1.875 * 0.8 / 1.0, rel=1e-6)
    assert_allclose(np.gradient(q[:, 3], 1e-3), dq[:, 3], atol=2e-5)
    u = np.clip(time - 2.5, 0, 1)
    assert_allclose(q[:, 3], 1.0 + 0.8 * (10 * u**3 - 15 * u**4 + 6 * u**5), atol=1e-12)
    assert q[-1].tolist() == pytest.approx([*REST[:2], 0.2, 1.8, *REST[4:]])


def hand_motion(**keys: Any) -> dict[str, Any]:
    x, y, z = HAND
    return impedance(reference={"program": "sinusoid", "centre": [x, y, z], "amplitude": [0, 0.1, 0.05], **keys})


@pytest.mark.parametrize("T_world_root", [Pose(), Pose((0.9, 0.2, 0.5), (0.0, 0.0, 1.0, 0.0))])
def test_joints_follow_a_program_of_the_hand_between_its_knots_too(T_world_root: Pose) -> None:
    x, y, z = HumanControl(ARM, {}, 0, T_world_root)._hand(REST).position
    human = HumanControl(ARM, hand_motion(centre=[x, y, z], cycles=1, begin=0.25), 0, T_world_root)
    reference = human._controller._reference  # type: ignore[attr-defined]
    human.start(0.0)
    worst = 0.0
    for time in np.arange(0.0, 6.0, 1.7e-3).tolist():
        q, _ = reference.at(time)
        worst = max(worst, math.dist(human._hand(q).position, reference._program.pose(time - 0.25).position))
    assert worst < 1e-5


def test_a_body_follows_the_hand_motion_in_a_simulation() -> None:
    human = HumanControl(ARM, hand_motion(cycles=1), 0)
    simulated = Simulated(ARM, REST)
    human.start(0.0)
    errors = []
    for k in range(5000):
        q, dq = simulated.state
        simulated.step(human.update(1e-3 * k, q, dq))
        desired = human._controller._reference._program.pose(1e-3 * k).position  # type: ignore[attr-defined]
        errors.append(np.linalg.norm(np.subtract(human._hand(q).position, desired)))
    assert 1e-3 < max(errors) < 0.1
    assert errors[-1] < 0.01


def test_a_motion_out_of_reach_is_refused_before_the_run() -> None:
    with pytest.raises(OutOfReachError) as refusal:
        HumanControl(ARM, hand_motion(amplitude=[0.6, 0.0, 0.0]), 0)
    assert "human.control.parameters.reference: " in str(refusal.value)
    assert "m from the right shoulder; valid: up to 0.625 m, the reach of the arm" in str(refusal.value)


def reactive(**keys: Any) -> HumanControl:
    content = {"program": "reactive", "rest": list(HAND), "too_near": 0.0, "pause": 5.0, **keys}
    return HumanControl(ARM, impedance(reference=content), 0)


def test_the_reactive_hand_draws_back_from_a_strong_force_after_both_delays() -> None:
    human = reactive(too_strong=20.0)
    human.start(0.0)
    x, y, z = HAND
    phases = []
    for k in range(4000):
        if k % 10 == 0:
            human.see(1e-3 * k, (x + 0.2, y + 0.1, z + 0.1))
        human.update(1e-3 * k, REST, ZERO, (0.0, 25.0 if 3000 <= k < 3100 else 5.0, 0.0))
        phases.append(human._controller._reference._hand.phase(1e-3 * k))  # type: ignore[attr-defined]
    assert phases[2900] == "pause" and phases[-1] == "retreat"
    assert phases.index("retreat") == pytest.approx(3000 + 80 + 50, abs=11)
    assert reactive(too_strong=0.0) is not None


def noisy(seed: int) -> HumanControl:
    x, y, z = HAND
    content = {
        "senses": {"joint_delay": 0.01, "joint_noise": 1e-3, "velocity_noise": 1e-2},
        **impedance(
            reference={
                "program": "minimum_jerk",
                "points": [[0, x, y, z], [0.5, x, y + 0.1, z]],
                "variation": {"position": 0.01, "time": 0.1},
            }
        ),
    }
    return HumanControl(ARM, content, seed)


def torques(human: HumanControl, cycles: int = 600) -> list[list[float]]:
    """The torques of a motion, during which the arm of the robot approaches."""
    simulated, found = Simulated(ARM, REST), []
    human.start(0.0)
    for k in range(cycles):
        human.see(1e-3 * k, (HAND[0] + max(0.2, 0.5 - 1e-3 * k), HAND[1], HAND[2]))
        found.append(human.update(1e-3 * k, *simulated.state))
        simulated.step(found[-1])
    return found


def test_all_is_the_same_bit_for_bit_from_a_seed() -> None:
    assert torques(noisy(1)) == torques(noisy(1)) != torques(noisy(2))


@pytest.mark.parametrize("new", [lambda: noisy(1), lambda: reactive(pause=0.2), lambda: HumanControl(ARM, {}, 0)])
def test_a_restart_is_as_good_as_a_new_person_bit_for_bit(new: Callable[[], HumanControl]) -> None:
    human, cycles = new(), 1500
    first = torques(human, cycles)
    for _ in range(2):
        human.restart()
        assert (human.posture, torques(human, cycles)) == (new().posture, first)


def test_a_restart_costs_a_part_of_a_new_person() -> None:
    share = cost_ratio(noisy(1).restart, lambda: noisy(1), times=1, rounds=5)
    print(f"a restart costs {share:.3f} of a new person")
    assert share < 0.25


USER = '''
    from dataclasses import dataclass

    from hric_core.parameters import Settings, number, per_joint
    from hric_human.control import HumanController


    @dataclass(frozen=True)
    class HoldSettings(Settings):
        stiffness: tuple[float, ...] = per_joint(number(unit="N m/rad", minimum=0.0), 20.0)


    class Hold(HumanController):
        """Holds where it starts."""

        settings = HoldSettings

        def init(self, person, settings):
            self._k, self._weight = settings.stiffness, person.own_weight

        def starting(self, time, senses):
            self._q = senses.q

        def update(self, time, senses):
            held, muscles = self._weight(senses.q), zip(*senses.muscles)
            return [k * (a - b - 0.05 * v) + g for k, a, (b, v), g in zip(self._k, self._q, muscles, held)]
'''


@pytest.fixture
def user_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "my_humans"
    package.mkdir()
    (package / "package.xml").write_text(
        '<package format="3"><name>my_humans</name><export>'
        '<hric_control plugin="${prefix}/plugins.xml"/></export></package>'
    )
    (package / "plugins.xml").write_text(
        '<library path="src"><class name="my_humans/Hold" type="my_hold:Hold" '
        'base_class_type="hric_human::HumanController"/></library>'
    )
    (package / "src").mkdir()
    (package / "src" / "my_hold.py").write_text(textwrap.dedent(USER))
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{Path(__file__).parents[2]}")


def test_a_users_controller_of_twenty_lines_is_found_by_its_name(user_package: None) -> None:
    assert len([line for line in USER.splitlines() if line.strip()]) <= 20
    human = HumanControl(ARM, {"type": "my_humans/Hold", "parameters": {"stiffness": 30.0}}, 0)
    held = human.person.own_weight(REST)
    assert human.update(0.0, REST, ZERO) == pytest.approx(held)
    assert human.update(0.001, [a - 0.01 for a in REST], ZERO) == pytest.approx([0.3 + g for g in held])


def refusals(content: Any) -> list[str]:
    with pytest.raises(ParameterError) as refusal:
        HumanControl(ARM, content, 0)
    return str(refusal.value).splitlines()


def test_wrong_parameters_are_refused_in_one_block_with_what_is_valid(user_package: None) -> None:
    lines = refusals(
        {
            "sid": "left",
            "senses": {"joint_delay": -1, "noise": 2},
            "parameters": {"stiffness": -3, "reference": {"program": "walk"}},
        }
    )
    text = "\n".join(lines)
    for line in (
        "no parameter 'sid' in human.control; valid: parameters, senses, side, type (did you mean side?)",
        "human.control.senses.joint_delay is -1; valid: a finite number from 0 to 1 [s]",
        "no program 'walk' in human.control.parameters.reference; valid: angles, c3d, joints, ",
        "human.control.parameters.stiffness",
    ):
        assert line in text
    assert len(lines) == 5
    assert refusals({"side": "left"}) == ["human.control.side is 'left'; valid: dominant or right"]
    assert refusals({"type": "my_humans/Held"}) == [
        "no human controller 'my_humans/Held' in human.control.type; valid: hric_gym/GuidedArm, "
        "hric_human/ImpedanceArm, my_humans/Hold "
        "(did you mean my_humans/Hold?)"
    ]


def test_a_load_that_a_joint_is_too_weak_for_is_refused_with_the_heaviest_that_it_holds() -> None:
    (line,) = refusals(impedance(load=45.0))
    found = re.fullmatch(
        r"human\.control\.parameters\.load is 45\.0; valid: up to (.*) \[kg\], which (.*) can hold at the start", line
    )
    assert found is not None, line
    heaviest, joint = float(found[1]), found[2]
    person = HumanControl(ARM, impedance(load=heaviest), 0).person
    index, hand = person.joints.index(joint), ARM.segments["right_hand"].link
    for load, holds in ((heaviest, True), (heaviest + 0.2, False)):
        torque = own_weight(ARM, person.gravity, {hand: load})(person.rest)[index]
        assert (person.weakest[index] <= torque <= person.strongest[index]) is holds


def test_joint_references_out_of_range_are_refused_together() -> None:
    points = [{"time": 0, "right_el_flex": 3.0, "right_knee": 1.0}, {"time": 1, "right_sh_flex": -2}]
    lines = refusals(impedance(reference={"program": "joints", "points": points}))
    where = "human.control.parameters.reference.points"
    assert lines[0] == f"{where}[0].right_el_flex is 3.0; valid: from 0.000 to 2.618 [rad]"
    assert lines[1].startswith(f"no joint 'right_knee' in {where}[0]; valid: ")
    assert lines[2] == f"{where}[1].right_sh_flex is -2.0; valid: from -1.047 to 3.142 [rad]"
    assert refusals(impedance(reference={"program": "joints", "points": [{"time": 1}, {"time": 1}]})) == [
        f"{where}: the times must increase, and be 0 s or later"
    ]


def test_a_cycle_of_the_law_costs_less_than_fifty_products_of_seven_numbers() -> None:
    """A cycle takes 30 us on a machine where the product of two lists of seven numbers takes 0.6 us."""
    human, k = HumanControl(ARM, hand_motion(cycles=5), 0), itertools.count()
    human.start(0.0)
    q = list(REST)
    ratio = cost_ratio(
        lambda: human.update(1e-3 * next(k), q, ZERO),
        lambda: [a * b for a, b in zip(q, ZERO, strict=True)],
    )
    print(f"a cycle costs {ratio:.1f} products")
    assert ratio < 50
