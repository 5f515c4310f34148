"""Limits and friction, as other packages read them."""

import panda_description
from panda_description import parameters


def test_joint_limits_come_in_order_with_the_arm_s_prefix() -> None:
    limits = panda_description.joint_limits("left")
    assert list(limits) == [f"left_joint{i}" for i in range(1, 8)]
    assert limits["left_joint4"] == panda_description.JointLimit(-3.0718, -0.0698, 2.175, 12.5, 6250.0, 87.0, 1000.0)


def test_an_fr3_has_its_published_limits() -> None:
    limit = panda_description.joint_limits("right", limits="fr3")["right_joint6"]
    assert limit == panda_description.JointLimit(0.5445, 4.5169, 4.18, 10.0, 5000.0, 12.0, 1000.0)
    assert panda_description.joint_limit_parameters(limits="fr3")["panda_joint6"]["min_position"] == 0.5445


def test_limits_under_the_names_of_ros_control_are_the_same_numbers() -> None:
    entry, limit = (
        panda_description.joint_limit_parameters()["panda_joint7"],
        panda_description.joint_limits()["panda_joint7"],
    )
    assert entry == {
        "has_position_limits": True,
        "min_position": limit.lower,
        "max_position": limit.upper,
        "has_velocity_limits": True,
        "max_velocity": limit.velocity,
        "has_acceleration_limits": True,
        "max_acceleration": limit.acceleration,
        "has_jerk_limits": True,
        "max_jerk": limit.jerk,
        "has_effort_limits": True,
        "max_effort": limit.effort,
        "has_effort_rate_limits": True,
        "max_effort_rate": limit.effort_rate,
    }


def test_cartesian_limits_are_the_panda_s_and_not_the_fr3_s() -> None:
    limits = panda_description.cartesian_limits()
    assert sorted(limits) == ["elbow", "rotation", "translation"]
    assert limits["translation"] == panda_description.CartesianLimit(2.0, 13.0, 6500.0)
    assert limits["elbow"].velocity == panda_description.joint_limits()["panda_joint1"].velocity


def test_friction_parameters_are_a_copy_with_three_coefficients_per_joint() -> None:
    first = panda_description.friction_parameters()
    assert first["panda_joint4"] == {"phi1": 1.2794, "phi2": 5.5903, "phi3": 0.036194}
    first["panda_joint4"]["phi1"] = 0.0
    assert panda_description.friction_parameters()["panda_joint4"]["phi1"] == 1.2794


def test_every_configuration_file_names_its_source() -> None:
    for path in sorted((parameters.share() / "config").glob("*.yaml")):
        head = "".join(line for line in path.read_text().splitlines(keepends=True) if line.startswith("#"))
        assert "ource" in head, path.name
        assert "[" in head or path.name == "meshes.yaml", f"{path.name} gives no unit"
