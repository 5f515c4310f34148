"""Contents of the model (frames, coordinates, forces) against numbers computed by hand."""

import math

import numpy as np
import opensim
import pytest
from small_robots import BODY, LIMIT, gripper, joint, link, one_joint, robot

import panda_description
from hric_core.geometry.transforms import rotation_onto
from urdf_to_osim import Conversion, Options, convert
from urdf_to_osim.transforms import body_xyz


def place(conversion: Conversion, name: str, **coordinates: float) -> np.ndarray:
    """Return the pose of a link in ground, shape (4, 4), with these coordinates."""
    state = conversion.model.initSystem()
    for coordinate, value in coordinates.items():
        conversion.model.getCoordinateSet().get(coordinate).setValue(state, value, False)
    conversion.model.realizePosition(state)
    frame = opensim.PhysicalFrame.safeDownCast(conversion.model.getComponent(conversion.frames[name].path))
    pose, T = frame.getTransformInGround(state), np.eye(4)
    R, p = pose.R(), pose.p()
    T[:3] = [[*(R.get(i, j) for j in range(3)), p.get(i)] for i in range(3)]
    return T


def test_the_panda_keeps_the_names_of_its_joints_and_links() -> None:
    conversion = convert(panda_description.load(fingers="prismatic"))
    moving = {name: joint.coordinates for name, joint in conversion.joints.items() if joint.coordinates}
    names = [f"panda_joint{i}" for i in range(1, 8)] + ["panda_finger_joint1", "panda_finger_joint2"]
    assert moving == {name: (name,) for name in names}
    assert conversion.frames["panda_link3"].path == "/bodyset/panda_link3"
    assert conversion.frames["panda_link8"].path == "/bodyset/panda_link7/panda_link8", "a link without mass is a frame"
    assert conversion.frames["world"].path == "/ground/world"


@pytest.mark.parametrize(("up", "tip"), [("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])])
def test_z_of_the_description_points_along_the_axis_that_is_up_and_gravity_down(up: str, tip: list[float]) -> None:
    conversion = convert(
        robot(link("base"), link("tip", ""), joint("j", "fixed", "base", "tip", '<origin xyz="0 0 1"/>')),
        Options(up=up),
    )
    assert place(conversion, "tip")[:3, 3] == pytest.approx(tip, abs=1e-15)
    assert conversion.model.getGravity().to_numpy() == pytest.approx(-9.81 * np.array(tip), abs=1e-15)


def test_y_up_turns_the_base_about_x_so_that_x_stays_x() -> None:
    assert place(convert(robot(link("base"))), "base")[:3, :3] == pytest.approx(
        np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]), abs=1e-15
    )


@pytest.mark.parametrize(
    ("normal", "x_axis", "y_axis"),
    [
        ("0 0 1", [1, 0, 0], [0, 1, 0]),
        ("0 0 -1", [1, 0, 0], [0, -1, 0]),
        ("1 0 0", [0, 0, -1], [0, 1, 0]),
        ("0 1 0", [1, 0, 0], [0, 0, -1]),
    ],
)
def test_a_planar_joint_moves_at_right_angles_to_its_axis_in_the_stated_directions(
    normal: str, x_axis: list[int], y_axis: list[int]
) -> None:
    urdf_xml = robot(link("floor"), link("cart"), joint("drive", "planar", "floor", "cart", f'<axis xyz="{normal}"/>'))
    conversion = convert(urdf_xml, Options(up="z"))
    assert conversion.joints["drive"].coordinates == ("drive_theta", "drive_x", "drive_y")
    assert place(conversion, "cart", drive_x=0.5)[:3, 3] == pytest.approx(0.5 * np.array(x_axis), abs=1e-15)
    assert place(conversion, "cart", drive_y=0.5)[:3, 3] == pytest.approx(0.5 * np.array(y_axis), abs=1e-15)
    axis = np.array([float(word) for word in normal.split()])
    turned = place(conversion, "cart", drive_theta=0.3)[:3, :3]
    assert turned @ axis == pytest.approx(axis, abs=1e-15)
    assert np.trace(turned) == pytest.approx(1 + 2 * math.cos(0.3), abs=1e-14)
    assert turned @ np.array(x_axis) == pytest.approx(
        math.cos(0.3) * np.array(x_axis) + math.sin(0.3) * np.array(y_axis), abs=1e-14
    )


def test_a_floating_joint_has_body_fixed_angles_and_a_position_in_the_joint_frame() -> None:
    conversion = convert(
        robot(link("ship", ""), link("boat"), joint("free", "floating", "ship", "boat", "")), Options(up="z")
    )
    assert conversion.joints["free"].coordinates == ("free_rx", "free_ry", "free_rz", "free_tx", "free_ty", "free_tz")
    T = place(conversion, "boat", free_rx=0.3, free_ry=-0.4, free_rz=0.5, free_tx=1.0, free_tz=3.0)
    assert T[:3, 3] == pytest.approx([1.0, 0.0, 3.0])
    assert body_xyz(T[:3, :3]) == pytest.approx((0.3, -0.4, 0.5))


def test_a_mimic_joint_starts_where_its_coupler_wants_it_and_is_not_driven() -> None:
    conversion = convert(gripper())
    conversion.model.initSystem()
    coordinates = conversion.model.getCoordinateSet()
    assert [coordinates.get(name).getDefaultValue() for name in ("left", "right")] == pytest.approx([0.0, 0.1])
    forces = {conversion.model.getForceSet().get(i).getName() for i in range(conversion.model.getForceSet().getSize())}
    assert "left_actuator" in forces and "right_actuator" not in forces


def effort(conversion: Conversion, name: str, q: float, dq: float) -> float:
    """What one force does at coordinate `swing` [N m], by the acceleration that it adds."""
    model = conversion.model
    state = model.initSystem()
    forces = model.updForceSet()
    for i in range(forces.getSize()):
        forces.get(i).setAppliesForce(state, False)
    coordinate = model.getCoordinateSet().get("swing")
    coordinate.setValue(state, q, False)
    coordinate.setSpeedValue(state, dq)
    model.realizeAcceleration(state)
    without, mass = coordinate.getAccelerationValue(state), opensim.Matrix()
    model.getMatterSubsystem().calcM(state, mass)
    forces.get(name).setAppliesForce(state, True)
    model.realizeAcceleration(state)
    return float(mass.to_numpy()[0, 0] * (coordinate.getAccelerationValue(state) - without))


LOSSES = f'{LIMIT}<dynamics damping="0.7" friction="1.5"/>'


def test_damping_is_minus_the_coefficient_times_the_speed_in_radians() -> None:
    assert effort(convert(one_joint(inside=LOSSES)), "swing_damping", 0.3, 2.0) == pytest.approx(-1.4)


def test_coulomb_friction_is_full_at_speed_and_76_percent_at_its_velocity() -> None:
    conversion = convert(one_joint(inside=LOSSES))
    assert effort(conversion, "swing_friction", 0.3, 1.0) == pytest.approx(-1.5)
    assert effort(conversion, "swing_friction", 0.3, -0.01) == pytest.approx(1.5 * math.tanh(1.0))


def test_sigmoid_friction_is_the_published_curve_and_zero_at_rest() -> None:
    phi1, phi2, phi3 = 0.54615, 5.1181, 0.039533
    conversion = convert(
        one_joint(),
        Options(friction="sigmoid", friction_parameters={"swing": {"phi1": phi1, "phi2": phi2, "phi3": phi3}}),
    )
    curve = phi1 / (1 + math.exp(-phi2 * (0.4 + phi3))) - phi1 / (1 + math.exp(-phi2 * phi3))
    assert effort(conversion, "swing_friction", 0.0, 0.4) == pytest.approx(-curve)
    assert effort(conversion, "swing_friction", 0.0, 0.0) == pytest.approx(0.0, abs=1e-12)


def test_a_stop_pushes_back_in_newton_metres_per_radian_beyond_its_transition_and_not_inside() -> None:
    conversion = convert(one_joint(), Options(stop_stiffness=500.0, stop_damping=3.0, stop_transition=0.02))
    assert effort(conversion, "swing_stop", 2.1, 0.0) == pytest.approx(-50.0)
    assert effort(conversion, "swing_stop", -1.1, 0.0) == pytest.approx(50.0)
    assert effort(conversion, "swing_stop", 2.1, 1.5) == pytest.approx(-50.0 - 4.5)
    assert effort(conversion, "swing_stop", 2.01, 0.0) == pytest.approx(-0.5 * 500.0 * 0.01)
    assert effort(conversion, "swing_stop", 1.99, 1.0) == pytest.approx(0.0, abs=1e-12)


def test_a_continuous_joint_has_no_stop_and_turns_all_round() -> None:
    conversion = convert(one_joint("continuous", '<limit effort="5" velocity="1"/>'))
    assert conversion.model.getForceSet().getSize() == 1
    actuator = opensim.CoordinateActuator.safeDownCast(conversion.model.getForceSet().get("swing_actuator"))
    assert (actuator.getMinControl(), actuator.getMaxControl()) == (-5.0, 5.0)


def test_a_range_without_a_sensible_end_has_no_stop() -> None:
    conversion = convert(
        one_joint(inside='<limit lower="-1e16" upper="1e16" effort="1" velocity="1"/>'), Options(actuators=False)
    )
    assert conversion.model.getForceSet().getSize() == 0


def test_what_is_switched_off_is_not_in_the_model() -> None:
    conversion = convert(
        one_joint(inside=LOSSES), Options(stops=False, damping=False, friction="none", actuators=False)
    )
    assert conversion.model.getForceSet().getSize() == 0


def test_a_joint_that_cannot_stand_at_zero_starts_at_the_nearer_end_of_its_range() -> None:
    conversion = convert(one_joint(inside='<limit lower="0.4" upper="0.9" effort="1" velocity="1"/>'))
    assert conversion.model.getCoordinateSet().get("swing").getDefaultValue() == 0.4


def test_a_repaired_inertia_is_the_nearest_that_a_body_has_and_is_reported() -> None:
    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="3"/></inertial>'
    conversion = convert(one_joint(child=body), Options(inertia="repair"))
    # Second moments 1.5, 1.5, -0.5; without the negative one the moments are 1.5, 1.5, 3.
    assert np.diag(conversion.plan.robot.links["arm"].mass.inertia) == pytest.approx([1.5, 1.5, 3.0], rel=1e-5)
    assert "link arm: its inertia breaks the triangle inequality" in conversion.notes[0]


def test_an_inertia_that_is_kept_stays_as_it_is_and_is_reported() -> None:
    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="3"/></inertial>'
    conversion = convert(one_joint(child=body), Options(inertia="keep"))
    assert np.diag(conversion.plan.robot.links["arm"].mass.inertia) == pytest.approx([1.0, 1.0, 3.0])
    assert "kept as it is" in conversion.notes[0]


def test_forbidden_names_are_changed_where_that_is_requested_and_reported() -> None:
    conversion = convert(
        robot(link("a b"), link("a_b"), joint("x/y", "revolute", "a b", "a_b")), Options(names="rename")
    )
    assert conversion.frames["a b"].path == "/bodyset/a_b_2"
    assert conversion.joints["x/y"].paths == ("/jointset/x_y/x_y",)
    assert len(conversion.notes) == 2 and "link 'a b': renamed to a_b_2" in conversion.notes[0]


def test_primitive_shapes_lie_where_the_description_puts_them() -> None:
    material = '<material name="m"><color rgba="1 0 0 0.5"/></material>'
    visual = (
        f'<visual><origin xyz="0 0 1"/><geometry><cylinder radius="0.1" length="0.4"/></geometry>{material}</visual>'
    )
    conversion = convert(robot(link("a", BODY + visual)), Options(up="z"))
    state = conversion.model.initSystem()
    frame = opensim.PhysicalFrame.safeDownCast(conversion.model.getComponent("/bodyset/a/a_visual_1"))
    assert frame.getPositionInGround(state).to_numpy() == pytest.approx([0.0, 0.0, 1.0])
    cylinder = opensim.Cylinder.safeDownCast(frame.get_attached_geometry(0))
    assert (cylinder.get_radius(), cylinder.get_half_height(), cylinder.getOpacity()) == (0.1, 0.2, 0.5)
    # OpenSim's cylinder stands along y of its frame, the description's along z.
    assert frame.expressVectorInGround(state, opensim.Vec3(0, 1, 0)).to_numpy() == pytest.approx(
        [0.0, 0.0, 1.0], abs=1e-15
    )


@pytest.mark.parametrize("seed", range(20))
def test_body_fixed_angles_give_the_rotation_back_also_beside_a_right_angle(seed: int) -> None:
    random = np.random.default_rng(seed)
    tilt = math.pi / 2 - 10.0 ** random.uniform(-16.0, 0.0) if seed % 2 else random.uniform(-1.5, 1.5)
    a, c = random.uniform(-math.pi, math.pi, 2)

    def rotation(x: float, y: float, z: float) -> np.ndarray:
        (sx, cx), (sy, cy), (sz, cz) = ((math.sin(v), math.cos(v)) for v in (x, y, z))
        return (
            np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
            @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
            @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
        )

    expected = rotation(a, tilt, c)
    assert rotation(*body_xyz(expected)) == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("start", [0, 1, 2])
def test_a_turn_takes_an_axis_onto_any_direction_also_nearly_opposite(start: int) -> None:
    random = np.random.default_rng(start)
    opposite = -np.eye(3)[start]
    for end in [
        *random.normal(size=(50, 3)),
        opposite,
        *(opposite + 10.0 ** -random.uniform(1, 16, (20, 1)) * random.normal(size=(20, 3))),
    ]:
        end = end / np.linalg.norm(end)
        R = rotation_onto(start, end)
        assert R[:, start] == pytest.approx(end, abs=1e-15)
        assert np.max(np.abs(R @ R.T - np.eye(3))) < 2e-15
        assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("geometry", "words"),
    [
        ('<box size="0 0 0"/>', "a <box> of size 0 0 0 shows nothing"),
        ('<cylinder radius="0.1" length="0"/>', "a <cylinder> of radius length 0.1 0 shows nothing"),
        ('<sphere radius="0"/>', "a <sphere> of radius 0 shows nothing"),
        ('<mesh filename="nowhere.stl" scale="0 0 0"/>', "a <mesh> of scale 0 0 0 shows nothing"),
    ],
)
def test_a_visual_of_size_zero_is_left_out_and_reported(geometry: str, words: str) -> None:
    visual = f"<visual><geometry>{geometry}</geometry></visual>"
    conversion = convert(
        robot(link("a", BODY + visual + '<visual><geometry><sphere radius="0.1"/></geometry></visual>'))
    )
    assert conversion.notes == [f"link a: <visual> number 1: left out, since {words}"]
    assert conversion.meshes == []
    conversion.model.initSystem()
    assert conversion.model.hasComponent("/bodyset/a/a_visual_2") and not conversion.model.hasComponent(
        "/bodyset/a/a_visual_1"
    )
