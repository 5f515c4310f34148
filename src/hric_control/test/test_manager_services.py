import logging

import pytest

from controller_manager_msgs.msg import ControllersStatistics
from controller_manager_msgs.srv import (
    ListControllersRequest,
    ListControllerTypesRequest,
    LoadControllerRequest,
    ReloadControllerLibrariesRequest,
    SwitchControllerRequest,
    UnloadControllerRequest,
)
from hric_control.manager import services
from hric_control.manager.loaded_controller import UpdateStatistics
from hric_control.manager.services import ManagerServices
from hric_core import plugins
from hric_core.scoped_node import ScopedNode

SERVICES = {
    "list_controllers": "ListControllers",
    "list_controller_types": "ListControllerTypes",
    "load_controller": "LoadController",
    "unload_controller": "UnloadController",
    "switch_controller": "SwitchController",
    "reload_controller_libraries": "ReloadControllerLibraries",
}


def test_the_six_services_have_upstreams_names_and_types(rig) -> None:
    ManagerServices(rig.manager, rig.node)
    assert rig.node.services() == {
        f"/controller_manager/{name}": f"controller_manager_msgs/{kind}" for name, kind in SERVICES.items()
    }


def test_a_controller_goes_through_its_life_by_service_calls(rig) -> None:
    ManagerServices(rig.manager, rig.node)
    call = rig.node.child("controller_manager").call
    assert call("load_controller", LoadControllerRequest("left")).ok
    assert call("switch_controller", SwitchControllerRequest(start_controllers=["left"], strictness=2)).ok
    (state,) = call("list_controllers", ListControllersRequest()).controller
    assert (state.name, state.state, state.type) == ("left", "running", "fake/Controller")
    (claim,) = state.claimed_resources
    assert (claim.hardware_interface, claim.resources) == ("hardware_interface::EffortJointInterface", ["joint1"])
    assert call("switch_controller", SwitchControllerRequest(stop_controllers=["left"], strictness=2)).ok
    assert call("unload_controller", UnloadControllerRequest("left")).ok
    assert call("list_controllers", ListControllersRequest()).controller == []


def test_the_types_come_with_their_base_class(rig) -> None:
    ManagerServices(rig.manager, rig.node)
    response = rig.node.call("controller_manager/list_controller_types", ListControllerTypesRequest())
    assert (
        dict(zip(response.types, response.base_classes, strict=True))["fake/Controller"] == "hric_control::Controller"
    )


@pytest.mark.parametrize(
    ("service", "request_", "reason"),
    [
        ("load_controller", LoadControllerRequest("absent"), "loading 'absent' refused: controller absent has no type"),
        (
            "unload_controller",
            UnloadControllerRequest("absent"),
            "no controller 'absent' in the manager, to unload; valid: left",
        ),
        (
            "switch_controller",
            SwitchControllerRequest(start_controllers=["absent"], strictness=2),
            "no controller 'absent'",
        ),
        ("reload_controller_libraries", ReloadControllerLibrariesRequest(False), "controllers are loaded (left)"),
    ],
)
def test_a_refusal_is_false_and_one_error_with_the_reason(
    rig, caplog: pytest.LogCaptureFixture, service: str, request_: object, reason: str
) -> None:
    ManagerServices(rig.manager, rig.node)
    rig.load("left")
    with caplog.at_level(logging.ERROR, "hric"):
        assert not rig.node.call(f"controller_manager/{service}", request_).ok
    assert len(caplog.records) == 1 and reason in caplog.text


def test_reloading_with_force_kill_is_granted(rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "reload", lambda base: [])
    ManagerServices(rig.manager, rig.node)
    rig.load("left")
    assert rig.node.call("controller_manager/reload_controller_libraries", ReloadControllerLibrariesRequest(True)).ok
    assert rig.states() == {}


def test_statistics_come_once_a_second_of_robot_time(rig) -> None:
    ManagerServices(rig.manager, rig.node)
    heard: list[ControllersStatistics] = []
    rig.node.subscribe("controller_manager/statistics", ControllersStatistics, heard.append)
    rig.start("left")
    rig.cycle(2500)
    assert [message.header.stamp.to_sec() for message in heard] == pytest.approx([0.0, 1.0, 2.0], abs=2e-3)
    (entry,) = heard[-1].controller
    assert entry.name == "left" and entry.running and entry.max_time.to_sec() > entry.mean_time.to_sec() >= 0.0


def test_the_field_for_the_variance_carries_its_root() -> None:
    snapshot = UpdateStatistics(
        "a", "t", True, 10, max_time=9e-6, mean_time=5e-6, variance_time=4e-12, overruns=1, last_overrun=0.5
    )
    (entry,) = services._statistics([snapshot], 1.5).controller
    assert (entry.max_time.to_nsec(), entry.mean_time.to_nsec(), entry.variance_time.to_nsec()) == (9000, 5000, 2000)
    assert (
        entry.timestamp.to_sec(),
        entry.num_control_loop_overruns,
        entry.time_last_control_loop_overrun.to_sec(),
    ) == (1.5, 1, 0.5)


def test_services_end_with_the_node_that_they_are_offered_through(rig) -> None:
    offered = ScopedNode(rig.node)
    ManagerServices(rig.manager, offered)
    offered.close()
    rig.cycle(10)
    assert rig.node.services() == {} and rig.node.topics() == {}
