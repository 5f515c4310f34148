"""`franka_control/...` on any arm: what it passes on, what it refuses by itself, and how a refusal of the arm is
told."""

import pytest

from franka_hw_interface.arm_services import ArmServices, CollisionThresholds
from franka_msgs.msg import ErrorRecoveryGoal
from franka_msgs.srv import (
    SetCartesianImpedanceRequest,
    SetEEFrameRequest,
    SetForceTorqueCollisionBehaviorRequest,
    SetFullCollisionBehaviorRequest,
    SetJointImpedanceRequest,
    SetKFrameRequest,
    SetLoadRequest,
)
from hric_core.errors import HricError, ParameterError
from hric_core.local.node import LocalNode
from hric_core.parameters import declared

POSE = [0.0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1]


class NotedArm:
    """Any arm: notes what it is told, between two cycles or not, and refuses on request."""

    def __init__(self) -> None:
        self.told: list[tuple] = []
        self.refusal = ""
        self.inside = False

    def request(self, function) -> None:
        self.inside = True
        try:
            function()
        finally:
            self.inside = False

    def __getattr__(self, name):
        def tell(*values) -> None:
            assert self.inside, "told outside the loop"
            if self.refusal:
                raise HricError(self.refusal)
            self.told.append((name, *values))

        return tell


@pytest.fixture
def arm():
    return NotedArm()


@pytest.fixture
def node(arm):
    node = LocalNode()
    services = ArmServices(arm, node)
    yield node
    services.unregister()
    assert not node.services() and not [name for name in node.topics() if "error_recovery" in name]


CALLS = {
    "set_load": (
        SetLoadRequest(1.0, [0.0, 0.0, 0.1], [1.0, 0, 0, 0, 1, 0, 0, 0, 1]),
        ("set_load", 1.0, [0.0, 0.0, 0.1], [1.0, 0, 0, 0, 1, 0, 0, 0, 1]),
    ),
    "set_EE_frame": (SetEEFrameRequest(POSE), ("set_EE_frame", POSE)),
    "set_K_frame": (SetKFrameRequest(POSE), ("set_K_frame", POSE)),
    "set_joint_impedance": (SetJointImpedanceRequest([3000.0] * 7), ("set_joint_impedance", [3000.0] * 7)),
    "set_cartesian_impedance": (SetCartesianImpedanceRequest([200.0] * 6), ("set_cartesian_impedance", [200.0] * 6)),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_setting_reaches_the_arm_between_two_cycles(arm, node, name) -> None:
    request, told = CALLS[name]
    response = node.call(f"franka_control/{name}", request)
    assert (response.success, response.error) == (True, "")
    assert arm.told == [told]


@pytest.mark.parametrize("name", CALLS)
def test_the_response_to_what_the_arm_refuses_has_its_reason(arm, node, name) -> None:
    arm.refusal = "not while moving"
    response = node.call(f"franka_control/{name}", CALLS[name][0])
    assert (response.success, response.error) == (False, "not while moving")


@pytest.mark.parametrize(
    ("name", "request_", "said"),
    [
        ("set_load", SetLoadRequest(-1.0, [0.0] * 3, [0.0] * 9), "must not be negative"),
        ("set_EE_frame", SetEEFrameRequest([1.0] * 16), "last row"),
        ("set_EE_frame", SetEEFrameRequest([*POSE[:14], 103.4, 1.0]), "valid: up to 2 m"),  # millimetres
        ("set_K_frame", SetKFrameRequest([float("nan")] * 16), "not finite"),
        ("set_joint_impedance", SetJointImpedanceRequest([-1.0] * 7), "7 finite numbers of 0 or more"),
        ("set_cartesian_impedance", SetCartesianImpedanceRequest([float("inf")] * 6), "6 finite numbers of 0 or more"),
    ],
)
def test_what_is_none_never_reaches_the_arm(arm, node, name, request_, said) -> None:
    response = node.call(f"franka_control/{name}", request_)
    assert not response.success and said in response.error
    assert arm.told == []


def thresholds(**values: float) -> dict[str, list[float]]:
    return {name: [value] * (7 if "torque" in name else 6) for name, value in values.items()}


def test_collision_thresholds_without_phases_count_in_all_of_them(arm, node) -> None:
    names = [f"{side}_{kind}_thresholds_nominal" for kind in ("torque", "force") for side in ("lower", "upper")]
    request = SetForceTorqueCollisionBehaviorRequest(
        **thresholds(**{name: 10.0 * n for n, name in enumerate(names, 1)})
    )
    response = node.call("franka_control/set_force_torque_collision_behavior", request)
    assert response.success, response.error
    ((_, told),) = arm.told
    assert [values[0] for values in told.lists()] == [10.0, 20.0, 10.0, 20.0, 30.0, 40.0, 30.0, 40.0]


def test_the_full_collision_thresholds_keep_their_places(arm, node) -> None:
    names = list(declared(CollisionThresholds))
    request = SetFullCollisionBehaviorRequest(**thresholds(**{name: float(n) for n, name in enumerate(names)}))
    assert node.call("franka_control/set_full_collision_behavior", request).success
    ((_, told),) = arm.told
    assert [values[0] for values in told.lists()] == [float(n) for n in range(8)]
    with pytest.raises(ParameterError, match=r"lower_torque_thresholds_nominal is .*; valid: a list of 7"):
        CollisionThresholds(**thresholds(**dict.fromkeys(names, 1.0)) | {"lower_torque_thresholds_nominal": [1.0] * 6})


def test_the_recovery_is_an_action_that_succeeds_or_says_why_not(arm, node) -> None:
    assert node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal()).status == "SUCCEEDED"
    assert arm.told == [("recover",)]
    arm.refusal = "the user stop is pressed"
    refused = node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal())
    assert (refused.status, refused.text) == ("ABORTED", "the user stop is pressed")
