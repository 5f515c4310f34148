"""Pairs of shapes that are checked for collisions, and rigid contact against closed formulas."""

import coal
import numpy as np
import pytest
from two_link import two_link_urdf

from hric_core.errors import DescriptionError
from opensim_ros_control.collision import MARGIN, Collisions
from opensim_ros_control.contact import ContactPoint, RigidContact
from opensim_ros_control.shapes import Pairing, pose

TABLE = "package://pybullet_ros_control/worlds/table.yaml"


def gaps(plant, pairs):
    """Return the true signed distance of each pair, by computing all of them."""
    kinematics, ask = plant.world.forces._kinematics, Pairing(MARGIN)
    plant.robot.synchronised()
    kinematics.forget()
    placed = [[pose(kinematics.pose(c.mobile) @ c.T_body_shape) for c in pair] for pair in pairs]
    return [
        ask.distance(a.shape.geometry, T_a, b.shape.geometry, T_b)
        for (a, b), (T_a, T_b) in zip(pairs, placed, strict=True)
    ]


def test_no_pair_that_is_near_is_left_out(make_plant, contact_urdf, rng):
    """The arm swings by random efforts over a table, a cube falls: the bound on what moved is never too small, and it
    saves most of the questions."""
    plant = make_plant(contact_urdf, world=TABLE, rotor_inertia=0.0)
    looked_at = near = possible = 0
    for _ in range(3):
        plant.reset(rng.uniform([-2.0, -1.0, -2.0, -2.5, -2.0, 0.5, -2.0], [2.0, 1.0, 2.0, -0.5, 2.0, 3.0, 2.0]))
        for _ in range(60):
            plant.apply(rng.uniform(-40.0, 40.0, 7) * [1, 1, 1, 1, 0.1, 0.1, 0.1])
            plant.step()
            collisions = plant.world.forces._collisions
            found = set(collisions.near(plant.robot.y[: plant.robot.engine.nu]))
            true = {i for i, gap in enumerate(gaps(plant, collisions.pairs)) if gap < MARGIN}
            assert true <= found
            looked_at, near, possible = looked_at + len(found), near + len(true), possible + len(collisions.pairs)
    assert near > 0
    assert looked_at < 0.1 * possible


def test_without_pairs_nothing_is_near():
    assert Collisions([], 3).near(np.zeros(3)) == []


ROUND = {"capsule": coal.Capsule(0.05, 0.2), "cylinder": coal.Cylinder(0.05, 0.2), "sphere": coal.Sphere(0.05)}


@pytest.mark.parametrize("pair", [("capsule", "capsule"), ("cylinder", "sphere"), ("sphere", "cylinder")])
def test_shapes_with_a_common_axis_part_across_it(pair, rng):
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    T = np.eye(4)
    T[:3, :3] = R * np.linalg.det(R)
    T_sphere = np.eye(4)
    a, b = (ROUND[name] for name in pair)
    T_a, T_b = (T_sphere if name == "sphere" else T for name in pair)
    touch = Pairing(MARGIN).touch(a, pose(T_a), b, pose(T_b))
    moved = T_a.copy()
    moved[:3, 3] = touch.depth * touch.normal
    assert Pairing(MARGIN).distance(a, pose(moved), b, pose(T_b)) == pytest.approx(0.0, abs=1e-6)


def on_a_floor(x, y, friction, depth=0.0):
    """A point of a rigid body of 1 kg whose speeds are those of its centre; turning about y by the third speed, with
    0.01 kg m^2."""
    J = np.array([[1.0, 0.0, 0.0, y], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -x]])
    return ContactPoint(
        "a", "b", (1, 0), np.zeros(3), np.array([0.0, 0.0, 1.0]), depth, J, (None, friction), (x,), np.zeros(3)
    )


GAIN = 1e-3 * np.diag([1.0, 1.0, 1.0, 100.0])


def test_a_body_on_two_points_stops_and_shares_its_weight_by_their_distances():
    points = [on_a_floor(-0.1, 0.0, 0.5), on_a_floor(0.3, 0.0, 0.5)]
    efforts = RigidContact(1e-3).solve(points, np.array([0.0, 0.0, -9.81e-3, 0.0]), GAIN)
    assert [point.force[2] for point in points] == pytest.approx([9.81 * 0.75, 9.81 * 0.25])
    assert efforts == pytest.approx([0.0, 0.0, 9.81, 0.0], abs=1e-9)


@pytest.mark.parametrize(("push", "slides"), [(4.0, False), (6.0, True)])
def test_friction_sticks_within_its_cone_and_slides_on_it(push, slides):
    point = on_a_floor(0.0, 0.0, 0.5)
    RigidContact(1e-3).solve([point], np.array([1e-3 * push, 0.0, -10e-3, 0.0]), GAIN)
    assert point.force == pytest.approx([-5.0 if slides else -push, 0.0, 10.0], abs=1e-3)


def test_rigid_contact_never_pulls_and_leaves_a_gap_its_time():
    contact, leaving, far = RigidContact(1e-3), on_a_floor(0.0, 0.0, 0.5), on_a_floor(0.0, 0.0, 0.5, depth=-1e-3)
    assert contact.solve([leaving], np.array([0.0, 0.0, 0.1, 0.0]), GAIN) == pytest.approx(0.0, abs=0.0)
    assert contact.solve([far], np.array([0.0, 0.0, -0.9, 0.0]), GAIN) == pytest.approx(0.0, abs=0.0)
    assert contact.solve([far], np.array([0.0, 0.0, -1.1, 0.0]), GAIN)[2] == pytest.approx(100.0)


PULLED = [  # places [m], depths [m], speeds, friction
    ((0.43, -0.39), (1.2e-3, 1.8e-3), (0.5, -0.09, 0.47, -1.3), 0.5),
    ((-0.36, 0.17), (1.1e-3, -0.5e-3), (-0.06, -0.13, 0.16, -1.43), 0.0),
    ((-0.34, 0.21), (1.5e-3, 1.0e-3), (0.6, 0.32, 0.39, -1.6), 0.5),
]


@pytest.mark.parametrize(("places", "depths", "v", "friction"), PULLED)
def test_where_the_direct_solution_would_pull_at_every_point_one_that_pulls_at_none_is_found(
    places, depths, v, friction
):
    contact, points = (
        RigidContact(1e-3),
        [on_a_floor(x, 0.0, friction, depth) for x, depth in zip(places, depths, strict=True)],
    )
    after = np.array(v) + GAIN @ contact.solve(points, np.array(v), GAIN)
    for point in points:
        assert point.force[2] >= 0.0
        assert point.normal @ point.J @ after >= contact._min_speed(point.depth) - 1e-6


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ('<cone radius="1"/>', "model thing: link a: <collision> number 1: its geometry is <cone>"),
        (
            '<box size="1 1 0"/>',
            r"link a: <collision> number 1: a <box> of size 1 1 0; all must be above 0 and below 1e\+09",
        ),
        (
            '<mesh filename="package://nowhere/none.stl"/>',
            "link a: <collision> number 1: mesh 'package://nowhere/none.stl': no package 'nowhere'",
        ),
    ],
)
def test_a_bad_shape_is_refused_by_its_link_and_the_world_is_as_before(make_plant, shape, message):
    plant = make_plant(two_link_urdf(), ["joint1", "joint2"])
    urdf = f"""<robot name="r"><link name="a"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry>{shape}</geometry></collision></link></robot>"""  # noqa: E501
    with pytest.raises(DescriptionError, match=message):
        plant.spawn("thing", urdf, np.eye(4))
    assert plant.model_names() == []
    plant.apply([0.0, 0.0])
    plant.step()
