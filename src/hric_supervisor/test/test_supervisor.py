"""The supervisor's core: distances, terms, modes, hysteresis, and what cannot be trusted."""

import itertools
import math
import subprocess
import sys
from contextlib import nullcontext

import numpy as np
import pinocchio
import pytest
from supervisor_rig import ARM, JOINTS, PERIOD, READY, Cell, ball, body, shape

import panda_description
from hric_assessment.contact.limits import Limits
from hric_assessment.contact.mass import Mechanism
from hric_assessment.contact.speed import speed_limit
from hric_assessment.separation.capsules import nearest_points, segment_distance
from hric_assessment.separation.stopping import MEASUREMENT, StopRow, StopTable, as_yaml
from hric_assessment.tables import limit_table
from hric_control.speed_scale import ScaleRequest, SpeedScale, stopping_time
from hric_core.errors import HricError
from hric_supervisor.arm import ArmShape, ArmState, InForce
from hric_supervisor.decision import FREE, SLOWED, STOPPED, Supervisor
from hric_supervisor.settings import MODES, SupervisorSettings

RNG = np.random.default_rng(5)
SPEED = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])


def model():
    made = pinocchio.buildModelFromXML(panda_description.load(arm_id="panda", meshes=False))
    return made, made.createData()


def full(made, q):
    values = pinocchio.neutral(made)
    for name, angle in zip(JOINTS, q, strict=True):
        values[made.joints[made.getJointId(name)].idx_q] = angle
    return values


@pytest.mark.parametrize("q", [READY, RNG.uniform(-1.0, 1.0, 7)])
def test_capsules_of_the_arm_are_where_another_library_has_its_links(q):
    made, data = model()
    pinocchio.framesForwardKinematics(made, data, full(made, q))
    for link, T in ARM.poses(np.array([q])).items():
        assert T[0] == pytest.approx(data.oMf[made.getFrameId(link)].homogeneous, abs=1e-12), link


def test_the_speed_of_a_place_of_the_arm_is_that_of_its_jacobian():
    made, data = model()
    dq = RNG.uniform(-1.0, 1.0, 7)
    placed = ARM.at(ArmState(0.0, READY, dq))
    speeds = full(made, np.zeros(7)) * 0.0
    for name, rate in zip(JOINTS, dq, strict=True):
        speeds[made.joints[made.getJointId(name)].idx_v] = rate
    pinocchio.forwardKinematics(made, data, full(made, READY), speeds)
    pinocchio.updateFramePlacements(made, data)
    for k in (0, 5, len(placed.links) - 1):
        frame = made.getFrameId(placed.links[k])
        twist = pinocchio.getFrameVelocity(made, data, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        for end in (0, 1):
            lever = placed.ends[k, end] - data.oMf[frame].translation
            assert placed.velocities[k, end] == pytest.approx(twist.linear + np.cross(twist.angular, lever), abs=2e-3)


def test_nearest_points_are_as_far_apart_as_the_segments():
    a, b = RNG.uniform(-1.0, 1.0, (2, 500, 2, 3))
    p, q = nearest_points(a, b)
    assert np.linalg.norm(p - q, axis=1) == pytest.approx(segment_distance(a, b), abs=1e-12)
    for point, ends in ((p, a), (q, b)):
        way = ends[:, 1] - ends[:, 0]
        share = np.einsum("ni,ni->n", point - ends[:, 0], way) / np.einsum("ni,ni->n", way, way)
        assert np.all((share >= -1e-9) & (share <= 1.0 + 1e-9))


def test_a_mesh_without_a_capsule_is_refused_by_name():
    urdf = panda_description.load(arm_id="panda", meshes=False)
    link = '<link name="extra"><collision><geometry><mesh filename="x.stl"/></geometry></collision></link>'
    joint = '<joint name="j" type="fixed"><parent link="panda_link8"/><child link="extra"/></joint></robot>'
    with pytest.raises(HricError, match=r"has no capsule: extra of panda"):
        ArmShape(urdf.replace("</robot>", link + joint), JOINTS)


def test_an_arm_on_a_rail_of_unknown_position_is_refused():
    urdf = panda_description.load(arm_id="panda", meshes=False)
    limit = '<limit lower="0" upper="1" effort="9" velocity="1"/>'
    rail = f'<joint name="rail" type="prismatic"><parent link="world"/><child link="cart"/>{limit}</joint>'
    urdf = urdf.replace('<parent link="world"/>', '<parent link="cart"/>').replace(
        "</robot>", f'<link name="cart"/>{rail}</robot>'
    )
    with pytest.raises(HricError, match="the position of rail of panda is not known"):
        ArmShape(urdf, JOINTS)


def test_far_away_the_arm_is_free_near_it_is_slowed_and_at_the_person_it_stands():
    cell = Cell()
    scales = [cell.decide(x).scale for x in np.arange(4.0, 0.9, -0.02).tolist()]
    assert scales[0] == 1.0 and scales[-1] == 0.0
    assert all(b <= a for a, b in itertools.pairwise(scales))
    assert {decision.state for decision in cell.decisions} == {FREE, SLOWED, STOPPED}
    assert cell.events() == ["slowed", "stopped"]


def test_the_scale_is_the_one_at_which_the_protective_distance_is_the_distance():
    own = SupervisorSettings()
    cell = Cell()
    decision = cell.decide(2.0)
    s, v = decision.scale, own.speed
    assert 0.1 < s < 0.95
    ramp, settling = stopping_time(s), own.settling_time
    human = 1.6
    expected = (
        human * (own.reaction_time + ramp + settling)
        + s * v * own.reaction_time
        + s * v * (0.5 * ramp + settling)
        + own.intrusion
        + own.person_uncertainty
        + own.robot_uncertainty
    )
    assert expected == pytest.approx(decision.separation, abs=2e-3)


def test_the_terms_that_are_told_are_those_of_the_measured_speeds():
    own = SupervisorSettings()
    cell = Cell()
    for x in (2.50, 2.48):
        decision = cell.decide(x, SPEED, in_force=InForce(0.0, 0.8, 0.8))
    part = decision.part
    towards = _direction(part)
    assert part.person_speed == pytest.approx(2.0 * towards[0], abs=1e-6)  # measured, faster than the table's 1.6
    time = own.reaction_time + stopping_time(0.8) + own.settling_time
    assert part.terms.person == pytest.approx(part.person_speed * time)
    assert part.terms.reaction == pytest.approx(part.robot_speed * own.reaction_time)
    assert decision.margin == pytest.approx(decision.separation - float(part.terms.total))
    # Where the scale falls the arm brakes, and nothing is left of the time until it does.
    part = cell.decide(2.46, SPEED, in_force=InForce(0.03, 0.6, 0.79)).part
    assert part.terms.person == pytest.approx(part.person_speed * (stopping_time(0.79) + own.settling_time))
    assert part.terms.reaction == 0.0


def test_an_arm_that_moves_too_near_is_a_violation_and_one_that_stands_is_none():
    assert not Cell().decide(1.0).violation
    cell = Cell()
    assert cell.decide(1.0, SPEED).violation and cell.events().count("violation") == 1
    cell.decide(1.0, SPEED)
    assert cell.events().count("violation") == 1


LEAN = np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0])


def braking(speed_of_person, start, lag=0.03, **settings):
    """A person comes along x to an arm that leans towards them, and follows its scale with a lag [s], to its stand."""
    cell, scale, q, dq = Cell(**settings), SpeedScale(), READY.copy(), LEAN.copy()
    in_force, x = InForce(), start
    while cell.time < 8.0 and np.abs(dq).max() > 1e-3:
        decision = cell.decide(float(x), dq, q, in_force=in_force)
        scale.request(ScaleRequest(decision.scale))
        for k in range(10):
            scale.advance(cell.time + 1e-3 * k, 1e-3)
            if k == 0:
                in_force = InForce(cell.time, scale.target, scale.value)
            dq = dq + (LEAN * scale.value - dq) * 1e-3 / lag
            q = q + dq * 1e-3
        x -= speed_of_person(cell.time) * PERIOD
    assert np.abs(dq).max() <= 1e-3
    return cell


@pytest.mark.parametrize("speed", [0.5, 1.6, 2.0])
def test_who_comes_evenly_never_comes_nearer_than_they_should_while_the_arm_brakes(speed):
    cell = braking(lambda time: speed, 3.0)
    assert "violation" not in cell.events() and cell.decisions[0].scale == 1.0
    # The distance that is required falls with the stop, to what is added for what is not known.
    own, last = SupervisorSettings(), cell.decisions[-1].part.terms
    assert float(last.total) == pytest.approx(own.intrusion + own.person_uncertainty + own.robot_uncertainty, abs=0.05)


def test_who_runs_faster_once_the_arm_brakes_violates_and_that_is_named():
    cell = braking(lambda time: 1.6 if time < 0.6 else 4.0, 3.0)
    assert cell.events().count("violation") == 1


def test_while_the_arm_brakes_a_pose_may_be_a_little_ahead_of_the_clock():
    cell, ahead = Cell(), 0.01
    for scale in (1.0, 0.8, 0.5, 0.0):
        now = round(cell.time + PERIOD, 9)
        decision = cell.decide(ball(now + ahead, 1.0), SPEED, arm_stamp=now + ahead, in_force=InForce(now, 0.0, scale))
    assert not decision.fault and decision.scale == 0.0 and decision.part.terms.reaction == 0.0


def test_an_arm_that_comes_to_rest_later_than_is_said_violates():
    assert "violation" in braking(lambda time: 1.6, 4.5, lag=0.15).events()
    assert "violation" not in braking(lambda time: 1.6, 4.5, lag=0.15, settling_time=0.7).events()


def test_an_arm_that_has_stood_and_moves_is_moved_by_others_and_that_is_told():
    cell = Cell()
    for dq in (STILL_ARM, STILL_ARM, SPEED):
        decision = cell.decide(1.0, dq)
    assert not decision.violation and cell.events() == ["stopped", "moved"]


STILL_ARM = np.zeros(7)


def test_it_goes_on_only_when_the_person_was_farther_away_for_a_while():
    cell = Cell(hold=0.3, hysteresis=0.05, person_max_speed=30.0)
    for _ in range(5):
        cell.decide(1.0)
    away = [*np.arange(1.25, 4.0, 0.25), *[4.0] * 40]  # no faster than a person may be
    scales = [cell.decide(distance).scale for distance in away]
    assert scales[:30] == [0.0] * 30 and scales[30] > 0.0 and scales[-1] == 1.0  # 0.3 s, 100 decisions a second
    # Trembling around an edge does not switch back and forth.
    cell = Cell(hold=0.3, hysteresis=0.05)
    for k in range(200):
        cell.decide(1.9 + (0.02 if k % 2 else 0.0))
    assert len(cell.events()) == 1


def stops(folder, *rows):
    table = StopTable("own", MEASUREMENT, "somebody", None, 0.02, tuple(StopRow(*row) for row in rows))
    path = folder / "stops.yaml"
    path.write_text(as_yaml(table))
    return str(path)


def test_measured_stops_take_the_place_of_the_settling_time(tmp_path):
    cell = Cell(
        stops=stops(tmp_path, (0.5, 0.0, 0.6, 0.2), (2.0, 0.0, 0.9, 0.5), (0.5, 1.0, 0.7, 0.25), (2.0, 1.0, 1.0, 0.6))
    )
    own = SupervisorSettings()
    part = cell.decide(2.5, SPEED).part
    speed = np.linalg.norm(ARM.at(ArmState(0.0, READY, SPEED)).velocities, axis=2).max()
    assert 0.05 < speed < 0.5
    # Of the largest load, from the next speed above; the distance by the speed towards the person.
    assert part.terms.person == pytest.approx(part.person_speed * (own.reaction_time + 0.02 + 0.7))
    assert part.terms.stopping == pytest.approx(part.robot_speed * max(0.25 / speed, 0.5 * stopping_time(1.0)))


def test_stops_that_are_shorter_than_the_speed_scale_needs_do_not_count(tmp_path):
    part = Cell(stops=stops(tmp_path, (2.0, 0.0, 0.01, 0.001))).decide(2.5, SPEED).part
    assert part.terms.person == pytest.approx(part.person_speed * (0.1 + 0.02 + stopping_time(1.0)))


def test_an_arm_that_is_faster_than_its_stops_are_known_is_stopped_and_that_is_named(tmp_path):
    file = stops(tmp_path, (0.32, 0.0, 0.5, 0.1))
    cell = Cell(stops=file)
    assert cell.decide(5.0).scale == pytest.approx(0.3)  # of 1 m/s
    decision = cell.decide(5.0, 3.0 * SPEED)
    assert decision.scale == 0.0 and "table of stops goes up to 0.32 m/s" in decision.fault


ONE_JOINT = """<robot name="ur5e"><link name="world"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><sphere radius="0.1"/>
</geometry></collision></link><joint name="shoulder" type="revolute"><parent link="world"/><child link="arm"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.parametrize(
    ("of", "name", "said"),
    [
        ("robot: ur10e", "ur5e", r"stops of ur10e in .*, but the robot is ur5e; valid: .* with robot: ur5e"),
        ("", "ur5e", "stops of a Franka arm in .*, but the robot is ur5e"),
        ("robot: ur5e", "ur5e", None),
        ("robot: ur5e", "panda", "stops of ur5e in .*, but the robot is panda"),
    ],
)
def test_stops_of_another_robot_are_refused(of, name, said, tmp_path):
    file = stops(tmp_path, (2.0, 0.0, 0.9, 0.5))
    with open(file, "a") as text:
        text.write(f"{of}\n")
    joints = ["shoulder"] if name == "ur5e" else JOINTS
    arm = ArmShape(ONE_JOINT, joints) if name == "ur5e" else ARM
    with pytest.raises(HricError, match=said) if said else nullcontext():
        Supervisor(SupervisorSettings(stops=file), arm)


EXPECTED = ((0.5, 0.1), (3.0, 0.4))
"""Distance [m] and speed [m/s] that a person expects."""


@pytest.mark.parametrize("mode", ["speed_and_separation", "power_and_force_limiting"])
def test_arm_is_not_faster_than_the_person_expects(mode):
    decision = Cell(mode=mode, expected=EXPECTED).decide(2.5)
    expected = np.interp(decision.separation, *np.array(EXPECTED).T)
    assert decision.scale == pytest.approx(expected)  # the speed at full scale is 1 m/s
    assert decision.reason == f"a person at {decision.separation:.2f} m expects at most {expected:.2f} m/s"


def test_expected_speeds_allow_no_faster_arm_than_the_distance():
    assert Cell(expected=((0.1, 5.0), (9.0, 5.0))).decide(1.2).scale == Cell().decide(1.2).scale < 1.0


def test_beyond_the_last_expected_distance_the_arm_is_free():
    assert Cell(expected=((0.5, 0.1), (1.0, 0.4))).decide(4.0).scale == 1.0


def test_expected_distances_that_do_not_increase_are_refused():
    with pytest.raises(HricError, match="expected: the distances must increase from row to row"):
        SupervisorSettings.of({"expected": [[1.0, 0.2], [0.5, 0.1]]}, "supervisor")


def test_standstill_knows_free_and_stopped_only():
    cell = Cell(mode="monitored_standstill")
    states = {cell.decide(x).state for x in np.arange(4.0, 1.0, -0.05).tolist()}
    assert states == {FREE, STOPPED}


def held(region, x=1.0, **settings):
    cell = Cell(mode="power_and_force_limiting", **settings)
    for _ in range(4):
        decision = cell.decide(ball(round(cell.time + PERIOD, 9), x, region))
    return decision


def test_a_contact_that_the_region_bears_need_not_stop_the_arm():
    hand, thigh, head = held("hand, fingers"), held("thigh, knee"), held("skull, forehead")
    assert head.scale == 0.0 and 0.0 < thigh.scale < hand.scale
    assert hand.stiffness == SupervisorSettings().contact_stiffness
    assert hand.force == Limits(limit_table()).at(("hand, fingers",)).force.quasi_static
    assert head.force == 0.0


@pytest.mark.parametrize("which", ["largest", "reflected", "standard", "locked"])
def test_the_contact_speed_follows_from_the_chosen_mass(which):
    decision = held("chest", robot_mass=which)
    mechanism, part = Mechanism(ARM.tree, JOINTS, [0.0] * 7), decision.part
    masses = mechanism.robot_masses(np.array(READY), part.robot_link, part.robot_point, _direction(part))
    mass = max(masses) if which == "largest" else getattr(masses, which)
    expected = float(speed_limit(Limits(limit_table()), "chest", mass).transient)
    assert decision.contact_speed == pytest.approx(expected) and decision.scale == pytest.approx(expected, rel=1e-6)


def _direction(part):
    way = np.array(part.person_point) - part.robot_point
    return way / np.linalg.norm(way)


def test_a_person_who_comes_uses_up_the_speed_of_a_contact_themself():
    cell = Cell(mode="power_and_force_limiting")
    scales = [cell.decide(ball(round(cell.time + PERIOD, 9), x, "hand, fingers")).scale for x in (1.2, 1.19, 1.18)]
    assert scales[-1] < scales[0]


def guided(angles=None, x=2.0, **settings):
    cell, standing = Cell(mode="hand_guided", **settings), shape(x)
    names = list(body().joints)
    angles = dict.fromkeys(names, 0.0) | (angles or {})
    for _ in range(40):
        now = round(cell.time + PERIOD, 9)
        decision = cell.decide(standing.seen(now, "world", angles))
    return decision


def test_without_a_hand_at_the_arm_guiding_is_a_standstill():
    decision = guided()
    assert decision.scale == 0.0 and "no guiding hand" in decision.reason


def test_a_hand_at_the_arm_leads_it_slowly_and_softly():
    cell = Cell(mode="hand_guided", hold=0.0)
    for _ in range(10):
        decision = cell.decide(ball(round(cell.time + PERIOD, 9), 0.57, "hand, fingers"))
    own = SupervisorSettings()
    assert decision.separation < own.guided_distance
    assert decision.scale == pytest.approx(own.guided_speed / own.speed)
    assert (decision.stiffness, decision.force) == (own.guided_stiffness, own.guided_force)


def test_a_guided_arm_that_is_known_to_be_faster_is_slowed_more():
    """The speed that counts is the fastest that was seen: a twist of the first joint moves the hand by 1.4 m/s."""
    cell = Cell(mode="hand_guided", hold=0.0, speed=0.2)
    for dq in (STILL_ARM, 5.0 * SPEED, STILL_ARM):
        decision = cell.decide(ball(round(cell.time + PERIOD, 9), 0.57, "hand, fingers"), dq)
    fastest = np.linalg.norm(ARM.at(ArmState(0.0, READY, 5.0 * SPEED)).velocities, axis=2).max()
    own = SupervisorSettings()
    assert fastest > own.guided_speed and decision.scale == pytest.approx(own.guided_speed / fastest)
    # An arm that is slower than guiding allows is not slowed.
    slow = Cell(mode="hand_guided", speed=0.2, hold=0.0)
    assert [slow.decide(ball(round(slow.time + PERIOD, 9), 0.57, "hand, fingers")).scale for _ in range(3)] == [1.0] * 3


STALE = ball(0.03, 3.0)
FAULTS = {
    "no pose of a person": lambda now: None,
    "frame 'mocap'": lambda now: ball(now, 3.0, frame="mocap"),
    "not finite": lambda now: ball(now, math.nan),
    "stale": lambda now: STALE,
    "ahead": lambda now: ball(now + 0.5, 3.0),
    "jumped back": lambda now: ball(now - 0.05, 3.0),
    "stamp of the person is not finite": lambda now: ball(math.nan, 3.0),
}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("said", FAULTS)
def test_what_cannot_be_trusted_stops_the_arm_and_is_named(said, mode):
    cell = Cell(mode=mode)
    for _ in range(3):
        cell.decide(3.5)
    if said == "stale":
        cell.time += 0.15
    decision = cell.decide(FAULTS[said](round(cell.time + PERIOD, 9)), seen=False)
    assert decision.scale == 0.0 and decision.state == STOPPED and said in decision.fault
    assert "fault" in [event.kind for event in decision.events] and math.isnan(decision.separation)
    for _ in range(50):
        decision = cell.decide(3.5)
    assert not decision.fault and "recovered" in cell.events()
    assert decision.scale == (0.0 if mode == "hand_guided" else 1.0)


@pytest.mark.parametrize(
    ("arm", "said"),
    [
        (None, "no state of the arm"),
        (ArmState(0.02, np.full(7, np.nan), np.zeros(7)), "arm is not finite"),
        (ArmState(0.0, READY, np.zeros(7)), "jumped back"),
    ],
)
def test_so_does_an_arm_of_which_nothing_is_known(arm, said):
    cell = Cell()
    cell.decide(3.5)
    decision = cell.supervisor.decide(0.02, arm, ball(0.02, 3.5))
    assert decision.scale == 0.0 and said in decision.fault


@pytest.mark.parametrize("jump", [-5.0, 30.0])
def test_a_jump_of_the_clock_stops_the_arm_and_is_named(jump):
    cell = Cell()
    for _ in range(3):
        cell.decide(3.5)
    cell.time += jump
    assert "clock jumped" in cell.decide(3.5).fault and cell.decisions[-1].scale == 0.0
    for _ in range(60):
        cell.decide(3.5)
    assert cell.decisions[-1].scale == 1.0


def test_one_fault_that_lasts_is_one_event():
    cell = Cell()
    cell.decide(3.5)
    for _ in range(100):
        cell.decide(None)
    assert cell.events().count("fault") == 1


def test_the_supervisor_loads_no_opensim():
    program = "import sys, hric_supervisor.app, hric_assessment.contact.impact\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not {"opensim", "urdf_to_osim"} & set(done.stdout.split())
