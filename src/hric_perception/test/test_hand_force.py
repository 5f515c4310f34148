"""Force on a person's hand, from the messages of a robot or a force plate."""

import numpy as np
import pytest
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from numpy.testing import assert_allclose

from franka_msgs.msg import FrankaState
from hric_core.errors import ParameterError
from hric_core.geometry import from_rotation_vector
from hric_perception.person.hand_force import source_of
from hric_perception.person.settings import PersonSettings

TURNED = {"xyz": [1.0, 2.0, 0.5], "xyzw": list(from_rotation_vector((0.0, 0.0, np.pi / 2)))}
"""Pose of the sensor in the markers' frame: the sensor's x axis is the frame's y axis."""


def settings(**force: object) -> PersonSettings:
    return PersonSettings.of({"force": force}, "person")


def test_the_hand_gets_what_the_robot_exerts_at_the_origin_of_its_stiffness_frame() -> None:
    state = FrankaState(O_F_ext_hat_K=[1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    end = np.eye(4)
    end[:3, :3], end[:3, 3] = [[1, 0, 0], [0, -1, 0], [0, 0, -1]], [0.4, 0.1, 0.6]
    stiffness = np.eye(4)
    stiffness[:3, 3] = [0.0, 0.02, 0.1]
    state.O_T_EE, state.EE_T_K = end.T.ravel().tolist(), stiffness.T.ravel().tolist()
    source = source_of(settings(source="robot", **TURNED).force)
    assert source is not None and source.topic == "franka_state_controller/franka_states"
    time, force, torque, point = source.read(7.0, state)
    assert time == 7.0
    assert_allclose(force, [-2.0, 1.0, 3.0], atol=1e-12)
    assert_allclose(torque, [-0.2, 0.1, 0.3], atol=1e-12)
    assert_allclose(point, [1.0 - 0.08, 2.0 + 0.4, 0.5 + 0.5], atol=1e-12)


def test_the_hand_gets_the_opposite_of_what_presses_on_a_plate() -> None:
    message = WrenchStamped(wrench=Wrench(Vector3(1.0, 2.0, -30.0), Vector3(0.1, 0.2, 0.3)))
    source = source_of(settings(source="plate", id="left", **TURNED).force)
    assert source is not None and source.topic == "hric/perception/force_plate/left/wrench"
    _, force, torque, point = source.read(7.0, message)
    assert_allclose(force, [2.0, -1.0, 30.0], atol=1e-12)
    assert_allclose(torque, [0.2, -0.1, -0.3], atol=1e-12)
    assert point == (1.0, 2.0, 0.5)


def test_the_force_is_that_on_their_dominant_hand_unless_another_is_named() -> None:
    assert settings().side is None and source_of(settings().force) is None
    assert settings(source="robot").side == "right" and settings(source="robot", hand="left").side == "left"
    with pytest.raises(ParameterError, match=r"force.source is 'scale'; valid: none, robot, plate"):
        settings(source="scale")
