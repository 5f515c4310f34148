"""What the box says of a motion that it ends for its command: which joint or quantity, its value, and the limit that
was passed."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import franka_limits
from franka_hw_interface.robot_state import RobotState
from franka_sim.box.config import motion_parameters
from franka_sim.box.motion import make_generator
from franka_sim.box.motion.cartesian import CartesianVelocityGenerator
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand

LIMITS = franka_limits()
DT = 0.001
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
JUMP, TWIST_JUMP = (
    "cartesian_motion_generator_joint_velocity_discontinuity",
    "cartesian_motion_generator_acceleration_discontinuity",
)
MEASURED = re.compile(
    r"\((?P<what>\w+) at (?P<value>\S+) (?P<unit>\S+), limit (?P<limit>\S+) \S+( and (?P<more>\d+) % more)?"
)


@pytest.fixture(scope="module")
def model() -> KdlFrankaModel:
    return KdlFrankaModel(panda_description.load(meshes=False, collision=False), "panda")


def command(**fields: Any) -> MotionCommand:
    zeros = {
        "q": [0.0] * 7,
        "dq": [0.0] * 7,
        "O_T_EE": [0.0] * 16,
        "O_dP_EE": [0.0] * 6,
        "elbow": None,
        "tau": [0.0] * 7,
    }
    return MotionCommand(**(zeros | fields))


def refusal(arm, generator: GeneratorMode, *commands: MotionCommand) -> tuple[frozenset[str], str]:
    """Return (errors, the log line about them) of a motion with these commands; only the last one may be refused."""
    arm.start(ControllerMode.JOINT_IMPEDANCE, generator)
    for one in commands:
        assert not arm.state.current_errors
        arm.cycle(one)
    assert arm.state.current_errors
    return arm.state.current_errors, arm.reports[-1]


def test_a_cartesian_motion_that_needs_too_much_of_a_joint_names_it_with_its_acceleration_and_the_limit(
    make_box,
) -> None:
    """Sideways at 6 m/s^2, within the end effector's 13: joint 1, 0.31 m away, would need 19.5 rad/s^2."""
    arm = make_box()
    errors, line = refusal(arm, GeneratorMode.CARTESIAN_VELOCITY, command(O_dP_EE=[0.0, 0.006, 0.0, 0.0, 0.0, 0.0]))
    assert errors == {JUMP} and JUMP in line
    found = MEASURED.search(line)
    assert found and (found["what"], found["unit"], found["more"]) == ("panda_joint1", "rad/s^2", "5")
    assert float(found["limit"]) == LIMITS.acceleration[0] == 15.0
    radius = math.hypot(*arm.state.O_T_EE[12:14])  # joint 3 is held: the arm turns about joint 1
    assert float(found["value"]) == pytest.approx(6.0 / radius, rel=1e-3)


def test_of_several_joints_the_one_that_passes_its_limit_by_most_is_named(make_box) -> None:
    arm = make_box()
    errors, line = refusal(arm, GeneratorMode.JOINT_VELOCITY, command(dq=[0.0, 0.016, 0.0, 0.0, -0.030, 0.0, 0.0]))
    assert "joint_motion_generator_velocity_discontinuity" in errors
    assert "panda_joint2 at 16 rad/s^2, limit 7.5 rad/s^2 and 5 % more" in line
    assert "panda_joint2 at 16000 rad/s^3, limit 3750 rad/s^3 and 20 % more" in line


def test_a_joint_that_leaves_its_range_or_is_no_number_is_named(model) -> None:
    for q1, dq, said in (
        (2.89729, [0.015, *[0.0] * 6], "panda_joint1 at 2.8973 rad, limit 2.8973 rad"),
        (0.0, [math.nan] * 7, "panda_joint1 at nan rad"),
    ):
        generator, state = make_generator(GeneratorMode.JOINT_VELOCITY, model, LIMITS), RobotState()
        state.q_d[:] = [q1, *READY[1:]]
        assert not generator.start(state) and generator.reason == ""
        assert generator.advance(command(dq=dq)) and said in generator.reason
        assert not generator.start(state) and generator.reason == ""


@pytest.mark.parametrize(
    ("index", "what", "limit"), [(0, "translation", LIMITS.translation), (4, "rotation", LIMITS.rotation)]
)
def test_a_twist_beyond_its_own_limits_names_which_part_of_it(make_box, index: int, what: str, limit) -> None:
    twist = [0.0] * 6
    twist[index] = 1.5 * limit.jerk * DT**2
    errors, line = refusal(make_box(), GeneratorMode.CARTESIAN_VELOCITY, command(O_dP_EE=twist))
    assert errors == {TWIST_JUMP}
    found = MEASURED.search(line)
    assert (
        found
        and (found["what"], found["more"]) == (what, "20")
        and found["unit"] == ("m/s^3" if index == 0 else "rad/s^3")
    )
    assert (float(found["value"]), float(found["limit"])) == pytest.approx((1.5 * limit.jerk, limit.jerk), rel=1e-3)


def test_an_elbow_beyond_its_limits_is_named(make_box) -> None:
    arm = make_box()
    T, elbow = arm.state.O_T_EE[:], arm.state.elbow
    errors, line = refusal(
        arm,
        GeneratorMode.CARTESIAN_POSITION,
        command(O_T_EE=T, elbow=(elbow[0], elbow[1])),
        command(O_T_EE=T, elbow=(elbow[0] + 1e-3, elbow[1])),
    )
    assert errors == {"cartesian_motion_generator_elbow_limit_violation"}
    assert "elbow at 1000 rad/s^2, limit 10 rad/s^2 and 5 % more" in line


def test_a_path_to_the_border_of_the_workspace_names_the_joint_that_cannot_follow(make_box) -> None:
    arm = make_box(q=[0.0, 0.3, 0.0, -0.6, 0.0, 0.9, 0.785])
    arm.box.set_collision_behavior(*[[1e3] * 7] * 4, *[[1e4] * 6] * 4)
    arm.start(ControllerMode.JOINT_IMPEDANCE, GeneratorMode.CARTESIAN_VELOCITY)
    way = np.array(arm.state.O_T_EE[12:15]) - [0.0, 0.0, 0.333]
    for k in range(4000):
        arm.cycle(command(O_dP_EE=[*(min(k * DT, 0.05) * way / np.linalg.norm(way)), 0.0, 0.0, 0.0]))
        if arm.state.current_errors:
            break
    assert arm.state.current_errors == {JUMP}
    assert re.search(r"panda_joint4 at \S+ rad/s\^2, limit 12.5 rad/s\^2 and 5 % more", arm.reports[-1])


def test_a_pose_that_the_inverse_kinematics_does_not_reach_is_named_as_such(model) -> None:
    """Here it is asked for more digits than there are."""
    generator, state = (
        CartesianVelocityGenerator(model, LIMITS, replace(motion_parameters(), ik_tolerance=1e-30), DT),
        RobotState(),
    )
    state.q_d[:] = READY
    assert not generator.start(state)
    assert generator.advance(command(O_dP_EE=[0.001, *[0.0] * 5])) == {JUMP}
    assert (
        generator.reason
        == "no joint motion leads to the commanded pose: it is at the border of the workspace, or singular"
    )


def test_a_motion_that_ends_in_full_speed_says_how_fast_it_was(make_box) -> None:
    arm = make_box()
    speeds = [command(dq=[0.005 * k, *[0.0] * 6]) for k in range(1, 20)]
    last = command(dq=[0.095, *[0.0] * 6], finished=True)
    errors, line = refusal(arm, GeneratorMode.JOINT_VELOCITY, *speeds, last)
    assert errors == {"joint_motion_generator_velocity_discontinuity"}
    assert "must bring it to rest within one step" in line
