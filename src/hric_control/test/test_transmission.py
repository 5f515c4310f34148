"""Transmissions, and reading them from a robot description."""

import pytest

from hric_control.transmission import SimpleTransmission, Transmission, parse_transmissions, robot_sim_type
from hric_core.errors import DescriptionError

ONE = """<transmission name="t1"><type>transmission_interface/SimpleTransmission</type>
<joint name="j1"><hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface>
<hardwareInterface>PositionJointInterface</hardwareInterface><offset>0.5</offset></joint>
<actuator name="m1"><mechanicalReduction>-50</mechanicalReduction></actuator></transmission>"""


def robot(content):
    links = "".join(f'<link name="{name}"/>' for name in "abc")
    joints = ("j1", "a", "b"), ("j2", "b", "c")
    ends = '<parent link="{}"/><child link="{}"/>'
    described = "".join(
        f'<joint name="{name}" type="continuous">{ends.format(*between)}</joint>' for name, *between in joints
    )
    return f'<robot name="r">{links}{described}{content}</robot>'


def test_a_transmission_is_read_with_short_interface_names():
    assert parse_transmissions(robot(ONE)) == [
        Transmission(
            -50.0,
            0.5,
            name="t1",
            type="SimpleTransmission",
            joint="j1",
            interfaces=("EffortJointInterface", "PositionJointInterface"),
            actuator="m1",
        )
    ]


def test_reduction_and_offset_default_to_none_and_the_interface_may_stand_at_the_actuator():
    text = """<transmission name="t2"><type>SimpleTransmission</type><joint name="j2"/>
    <actuator name="m2"><hardwareInterface>VelocityJointInterface</hardwareInterface></actuator></transmission>"""
    assert parse_transmissions(robot(text)) == [
        Transmission(
            name="t2",
            type="SimpleTransmission",
            joint="j2",
            interfaces=("VelocityJointInterface",),
            actuator="m2",
        )
    ]


def test_the_gear_maps_power_onto_itself_and_positions_by_the_offset():
    gear = SimpleTransmission(reduction=-50.0, offset=0.5)
    assert gear.joint_to_actuator_effort(100.0) * gear.joint_to_actuator_velocity(2.0) == pytest.approx(100.0 * 2.0)
    assert gear.joint_to_actuator_position(0.5) == 0.0
    assert gear.joint_to_actuator_position(0.6) == pytest.approx(-5.0)


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        (
            "EffortJointInterface",
            "ForceInterface",
            "no hardware interface 'ForceInterface'; valid: hardware_interface/EffortJointInterface",
        ),
        ('joint name="j1"', 'joint name="j9"', "transmission t1: no joint 'j9'; valid: j1, j2"),
        ("-50", "0", "transmission t1: mechanicalReduction must not be 0"),
        ("-50", "big", "transmission t1: mechanicalReduction must be a finite number; got 'big'"),
        (
            '<actuator name="m1">',
            '<actuator name="m0"/><actuator name="m1">',
            "a SimpleTransmission needs exactly one <actuator>; it has 2",
        ),
    ],
)
def test_what_is_not_known_is_refused_with_what_is(before, after, says):
    with pytest.raises(DescriptionError) as caught:
        parse_transmissions(
            robot(ONE.replace(before, after, 1) if before != 'joint name="j1"' else ONE.replace(before, after))
        )
    assert says in str(caught.value)


@pytest.mark.parametrize(
    "kind",
    [
        "<type>transmission_interface/DifferentialTransmission</type>",
        "<type>transmission_interface::FourBarLinkageTransmission</type>",
        "<type>pr2_mechanism_model/SimpleTransmission</type>",
        "<type>franka_hw/FrankaStateInterface</type>",
        "<type>transmission_interface/SimpleTransmission</type>",
        "",
    ],
)
def test_transmissions_of_another_type_are_left_out_with_one_warning_that_names_them(kind, caplog):
    joint = '<joint name="{}"><role>joint1</role></joint>'
    foreign = (
        f'<transmission name="t{{}}">{kind}{joint.format("j2")}{joint.format("j9")}<actuator name="m"/></transmission>'
    )
    found = parse_transmissions(robot(foreign.format(8) + ONE + foreign.format(9)))
    assert [one.name for one in found] == ["t1"]
    (record,) = caplog.records
    name = kind.removeprefix("<type>").removesuffix("</type>").replace("::", "/") or "(missing)"
    name += " without <hardwareInterface>" if name == "transmission_interface/SimpleTransmission" else ""
    assert record.levelname == "WARNING"
    for number in (8, 9):
        assert f"t{number} of type {name} (joints j2, j9)" in record.getMessage()


def test_a_joint_with_two_transmissions_is_refused_with_both_names():
    with pytest.raises(DescriptionError, match="joint j1 has two transmissions: t1 and t3"):
        parse_transmissions(robot(ONE + ONE.replace("t1", "t3")))


def test_the_description_says_which_robot_hw_simulates_it():
    text = (
        '<gazebo><plugin name="{}" filename="{}"><robotSimType> franka_sim/FrankaHWSim '
        "</robotSimType></plugin></gazebo>"
    )
    assert robot_sim_type(robot(text.format("gazebo_ros_control", "x.so"))) == "franka_sim/FrankaHWSim"
    assert robot_sim_type(robot(text.format("control", "libgazebo_ros_control.so"))) == "franka_sim/FrankaHWSim"
    assert robot_sim_type(robot(text.format("camera", "libcamera.so"))) is None
    assert robot_sim_type(robot("")) is None
