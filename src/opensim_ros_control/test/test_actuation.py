"""Forces and constraints in the joints: limits, brakes, friction, stops, drives."""

import numpy as np
import pytest
from rigid_body_oracle import Oracle
from two_link import two_link_urdf

import panda_description
from hric_control.plant import Load, Mode

POSE = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]
EVERY = pytest.mark.parametrize(
    "config",
    [{"rotor_inertia": 0.0}, {"rotor_inertia": 0.1}, {"rotor_inertia": 0.0, "integrator": "semi_implicit"}],
    ids=["manager", "rotors", "semi_implicit"],
)


def steps(plant, n, tau=None):
    tau = [0.0] * len(plant.joint_names) if tau is None else tau
    for _ in range(n):
        plant.apply(tau)
        plant.step()
    return [np.array(part) for part in plant.engine_state()]


def read_effort(plant):
    n = len(plant.joint_names)
    tau = [0.0] * n
    plant.read_state([0.0] * n, [0.0] * n, tau)
    return tau


def free(config):
    """Return the configuration with velocities read without the difference of half a step."""
    return {**config, "half_step_readout": False}


@EVERY
def test_efforts_beyond_the_limits_of_the_description_are_cut(make_plant, config):
    urdf = two_link_urdf(limit='lower="-20" upper="20" effort="5" velocity="5"')
    plant = make_plant(urdf, JOINTS, q=[0.0, 0.0], gravity=STILL, **config)
    weak = steps(plant, 20, [500.0, -500.0])
    assert plant.motor_effort() == [5.0, -5.0]
    plant.reset([0.0, 0.0])
    assert np.array_equal(steps(plant, 20, [5.0, -5.0]), weak)
    strong = make_plant(urdf, JOINTS, q=[0.0, 0.0], gravity=STILL, effort_limits=False, **config)
    assert abs(steps(strong, 20, [500.0, -500.0])[1][0]) > 5.0 * abs(weak[1][0])


@EVERY
def test_brakes_hold_a_loaded_arm_still_and_free_it(make_plant, panda_urdf, config):
    plant = make_plant(panda_urdf, q=POSE, **config)
    load = Load(3.0, (0.0, 0.0, 0.1))
    plant.set_load(load)
    plant.set_brakes([True] * 7)
    start = np.array(plant.engine_state()[0])
    q, dq = steps(plant, 100, [5.0] * 7)
    assert np.array_equal(q, start) and not dq.any()
    oracle = Oracle(panda_urdf)
    import pinocchio

    hand = oracle.model.frames[oracle.model.getFrameId(plant.tree.joints[plant.joint_names[-1]].child)]
    oracle.model.appendBodyToJoint(
        hand.parentJoint, pinocchio.Inertia(3.0, np.array(load.com), np.zeros((3, 3))), hand.placement
    )
    # A brake carries what the joint needs to stand.
    assert read_effort(plant) == pytest.approx(oracle.gravity(start), abs=1e-9)
    plant.set_brakes([False] * 7)
    assert np.abs(steps(plant, 100)[0] - start).max() > 1e-2


@EVERY
def test_a_partly_braked_arm_moves_as_an_arm_without_the_braked_joint(make_plant, config):
    plant = make_plant(two_link_urdf(), JOINTS, **free(config))
    plant.reset([0.3, 0.2])
    plant.set_brakes([True, False])
    rotor = config["rotor_inertia"]
    oracle = Oracle(two_link_urdf(), rotor)
    q, dq = np.array([0.3, 0.2]), np.zeros(2)
    for _ in range(300):
        M, h = oracle.mass_matrix(q) + rotor * np.eye(2), oracle.bias(q, dq)
        dq[1] += 1e-3 * (-h[1] / M[1, 1])
        q[1] += 1e-3 * dq[1]
        steps(plant, 1)
    assert np.abs(np.array(plant.engine_state()) - [q, dq]).max() < (1e-10 if "integrator" in config else 1e-2)
    assert plant.engine_state()[0][0] == pytest.approx(0.3, abs=1e-12)


@EVERY
def test_a_brake_that_closes_in_motion_passes_the_impulse_to_the_free_joints(make_plant, config):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL, **free(config))
    plant.reset([0.3, 0.2], [1.0, 0.5])
    plant.set_brakes([True, False])
    M = Oracle(two_link_urdf()).mass_matrix(np.array([0.3, 0.2])) + config["rotor_inertia"] * np.eye(2)
    assert plant.engine_state()[1] == pytest.approx([0.0, 0.5 + M[1, 0] / M[1, 1]], abs=1e-9)


def test_brakes_stay_with_a_new_load_and_a_reset(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=POSE)
    plant.set_brakes([True] * 7)
    plant.set_load(Load(1.0))
    assert np.array_equal(steps(plant, 20)[0], POSE)
    plant.reset([x + 0.1 for x in POSE])
    assert np.array_equal(steps(plant, 20)[0], [x + 0.1 for x in POSE])


@EVERY
def test_coulomb_friction_holds_below_its_value_and_slides_above(make_plant, config):
    urdf = two_link_urdf(friction=0.5)
    plant = make_plant(urdf, JOINTS, q=[0.0, 0.0], friction="coulomb", gravity=STILL, **config)
    q, _dq = steps(plant, 300, [0.45, 0.0])
    assert np.abs(q).max() < 1e-9
    # Joint 2 is held by its friction: it moves with joint 1 as one body.
    _q, dq = steps(plant, 300, [0.55, 0.0])
    whole = Oracle(urdf).mass_matrix(np.zeros(2))[0, 0] + config["rotor_inertia"]
    assert dq[0] == pytest.approx(0.3 * 0.05 / whole, rel=2e-3)
    assert abs(dq[1]) < 1e-6


@EVERY
def test_coulomb_friction_brakes_a_sliding_joint_by_its_value(make_plant, config):
    urdf = two_link_urdf(friction=0.5)
    plant = make_plant(urdf, JOINTS, friction="coulomb", gravity=STILL, **free(config))
    plant.reset([0.0, 0.0], [1.0, 0.0])
    _q, dq = steps(plant, 100)
    whole = Oracle(urdf).mass_matrix(np.zeros(2))[0, 0] + config["rotor_inertia"]
    assert dq[0] == pytest.approx(1.0 - 0.1 * 0.5 / whole, abs=1e-3)


def test_friction_of_the_description_does_nothing_unless_requested(make_plant):
    plant = make_plant(two_link_urdf(friction=0.5), JOINTS, q=[0.0, 0.0], rotor_inertia=0.0, gravity=STILL)
    assert steps(plant, 100, [0.1, 0.0])[1][0] > 1e-3


@EVERY
def test_damping_of_the_description_acts(make_plant, config):
    plant = make_plant(two_link_urdf(damping=0.8), JOINTS, **free(config))
    plant.reset([0.3, 0.2], [1.0, -2.0])
    oracle = Oracle(two_link_urdf(), config["rotor_inertia"], damping=0.8, steps_per_period=8)
    q, dq = np.array([0.3, 0.2]), np.array([1.0, -2.0])
    if "integrator" in config:
        expected = dq + 1e-3 * oracle.acceleration(q, dq, np.zeros(2))
    else:
        _, expected = oracle.hold(q, dq, np.zeros(2))
    assert np.abs(steps(plant, 1)[1] - expected).max() < 1e-7


@EVERY
def test_identified_friction_is_the_published_sigmoid(make_plant, panda_urdf, config):
    parameters = panda_description.friction_parameters()
    q, dq = np.array(POSE), np.linspace(-2.0, 2.0, 7)
    phi1, phi2, phi3 = (np.array([parameters[f"panda_joint{i}"][f"phi{k}"] for i in range(1, 8)]) for k in (1, 2, 3))
    tau_f = phi1 / (1 + np.exp(-phi2 * (dq + phi3))) - phi1 / (1 + np.exp(-phi2 * phi3))
    # A step so short that the acceleration at its beginning is all there is.
    plant = make_plant(
        panda_urdf, friction="identified", friction_parameters=parameters, time_step=1e-7, **free(config)
    )
    plant.reset(q.tolist(), dq.tolist())
    expected = Oracle(panda_urdf, config["rotor_inertia"]).acceleration(q, dq, -tau_f)
    assert (steps(plant, 1)[1] - dq) / 1e-7 == pytest.approx(expected, rel=1e-3, abs=1e-3)


@EVERY
def test_a_stop_holds_a_pushing_joint(make_plant, config):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL, **config)
    plant.reset([1.9, 0.0])
    top = 0.0
    for _ in range(300):
        top = max(top, steps(plant, 1, [20.0, 0.0])[0][0])
    print(f"overshoot {top - 2.0:.1e} rad")
    assert top < 2.005
    for _ in range(300):
        q, dq = steps(plant, 1, [20.0 - 5.0 * plant.engine_state()[1][0], -5.0 * plant.engine_state()[1][1]])
    assert q[0] == pytest.approx(2.0, abs=1e-6)
    assert abs(dq[0]) < 1e-3


@EVERY
def test_a_stop_acts_only_once_the_joint_has_been_inside(make_plant, config):
    plant = make_plant(two_link_urdf(), JOINTS, q=[2.3, 0.0], gravity=STILL, **config)
    acceleration = Oracle(two_link_urdf(axis="0 0 1"), config["rotor_inertia"]).acceleration(
        np.zeros(2), np.zeros(2), np.array([1.0, 0.0])
    )
    q, dq = steps(plant, 100, [1.0, 0.0])
    # Outside, nothing hinders it, in either direction.
    assert q[0] == pytest.approx(2.3 + 0.5 * 0.1**2 * acceleration[0], abs=5e-4)
    plant.set_load(Load(0.5))
    assert steps(plant, 100, [1.0, 0.0])[0][0] > q[0]
    for _ in range(3000):
        q, dq = steps(plant, 1, [-3.0 - 5.0 * dq[0], -5.0 * dq[1]])
        if q[0] < 1.9:
            break
    assert q[0] < 1.9
    for _ in range(1500):
        q, dq = steps(plant, 1, [5.0 - 2.0 * dq[0], -5.0 * dq[1]])
    assert q[0] == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_stop_acts_as_that_of_the_other_engine(make_plant, rotor):
    from pybullet_ros_control.plant import PyBulletPlant

    config = {"rotor_inertia": rotor, "gravity": STILL, "integrator": "semi_implicit"}
    ours = make_plant(two_link_urdf(), JOINTS, q=[1.5, 0.0], **config)
    other = PyBulletPlant(two_link_urdf(), JOINTS, config)
    other.reset([1.5, 0.0])
    paths = []
    for plant in (ours, other):
        path = []
        for _ in range(800):
            dq = plant.engine_state()[1]
            path.append(steps(plant, 1, [3.0 - 2.0 * dq[0], -2.0 * dq[1]])[0])
        paths.append(np.array(path))
    other.close()
    assert paths[0][:, 0].max() > 1.999
    print(f"rotor inertia {rotor}: {np.abs(paths[0] - paths[1]).max():.1e} rad apart")
    assert np.abs(paths[0] - paths[1]).max() < 5e-3


@EVERY
def test_velocity_and_position_drives_follow_their_targets_under_gravity(make_plant, config):
    urdf = two_link_urdf(limit='lower="-2" upper="2" effort="50000" velocity="50"')
    plant = make_plant(urdf, JOINTS, q=[0.3, 0.2], **config)
    plant.set_modes([Mode.VELOCITY, Mode.POSITION])
    q, dq = steps(plant, 200, [0.5, 0.4])
    assert q == pytest.approx([0.4, 0.4], abs=1e-3)
    assert dq == pytest.approx([0.5, 0.0], abs=1e-3)
    assert abs(read_effort(plant)[0]) > 5.0
    plant.set_modes([Mode.EFFORT, Mode.EFFORT])
    assert steps(plant, 50)[1][0] > 0.51


@EVERY
def test_a_drive_gives_no_more_than_the_description_allows(make_plant, config):
    weak = two_link_urdf(limit='lower="-2" upper="2" effort="3" velocity="0.5"')
    plant = make_plant(weak, JOINTS, q=[0.0, 0.0], gravity=STILL, **config)
    plant.set_modes([Mode.POSITION, Mode.POSITION])
    _q, dq = steps(plant, 400, [1.0, 0.0])
    assert dq[0] == pytest.approx(0.5, abs=1e-4)


@EVERY
def test_a_mimic_joint_follows_also_with_rotors_and_brakes(make_plant, config):
    head, _, tail = two_link_urdf().rpartition("</joint>")
    urdf = f'{head}<mimic joint="joint1" multiplier="-0.5" offset="0.1"/></joint>{tail}'
    plant = make_plant(urdf, ["joint1"], **config)
    plant.reset([0.3])
    indices = plant.robot.engine.index
    first, second = indices["/jointset/joint1/joint1"], indices["/jointset/joint2/joint2"]
    rotor, oracle = config["rotor_inertia"], Oracle(two_link_urdf())
    C = np.array([1.0, -0.5])
    q = np.array([0.3, -0.05])
    x = C @ (-oracle.gravity(q)) / (C @ (oracle.mass_matrix(q) + np.diag([rotor, 0.0])) @ C)
    steps(plant, 1)
    assert plant.robot.speeds[first] == pytest.approx(1e-3 * x, rel=1e-3)
    steps(plant, 200)
    assert plant.robot.positions[second] == pytest.approx(-0.5 * plant.robot.positions[first] + 0.1, abs=1e-9)
    plant.set_brakes([True])
    before = plant.robot.q[:]
    steps(plant, 50)
    assert plant.robot.q == pytest.approx(before, abs=1e-9)


@EVERY
def test_passive_joints_swing_or_are_locked(make_plant, config):
    for mode, moves in (("free", True), ("locked", False)):
        plant = make_plant(two_link_urdf(), ["joint1"], passive_joints=mode, **config)
        plant.reset([0.0])
        index = plant.robot.engine.index["/jointset/joint2/joint2"]
        steps(plant, 100)
        assert (abs(plant.robot.positions[index]) > 1e-2) == moves
