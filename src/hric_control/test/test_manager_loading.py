import pytest
from recorded_calls import FakeController, RecordingRobotHW
from std_msgs.msg import Float64
from std_srvs.srv import Empty

from hric_control.controller import Controller
from hric_control.hardware_interface import EffortJointInterface
from hric_control.manager.controller_manager import ControllerManager
from hric_core import plugins
from hric_core.errors import CommandError, HricError, ParameterError, UnknownNameError
from hric_core.local.node import LocalNode


def test_a_loaded_controller_is_initialized_and_not_running(rig) -> None:
    rig.load("left")
    assert rig.states() == {"left": "initialized"}
    assert rig.made["left"].calls == ["init"]
    rig.cycle(3)
    assert rig.made["left"].calls == ["init"]


def test_a_controller_gets_its_own_namespace_and_the_robots(rig) -> None:
    rig.load("left")
    assert rig.made["left"].node.namespace == "/left"


def test_the_list_tells_type_and_claimed_joints(rig) -> None:
    rig.load("both", "reader")
    both, reader = rig.manager.list()
    assert (both.name, both.type, both.claims) == (
        "both",
        "fake/Controller",
        {"hardware_interface::EffortJointInterface": ("joint1", "joint2")},
    )
    assert reader.claims == {}


def test_a_name_can_be_loaded_once(rig) -> None:
    rig.load("left")
    with pytest.raises(HricError, match="controller left is loaded already"):
        rig.manager.load("left")


def test_a_controller_without_a_type_is_refused_with_the_parameter_that_is_missing(rig) -> None:
    with pytest.raises(ParameterError, match="controller absent has no type: set the parameter /absent/type"):
        rig.manager.load("absent")


def test_an_unknown_type_is_refused_with_the_types_that_exist() -> None:
    manager = ControllerManager(RecordingRobotHW(), LocalNode({"pd": {"type": "hric_controllers/JointPDControler"}}))
    with pytest.raises(
        UnknownNameError,
        match=r"no hric_control::Controller '\S+/JointPDControler'.*hric_controllers/JointPDController",
    ):
        manager.load("pd")


def test_the_text_of_a_failed_init_is_the_reason_and_nothing_is_loaded(rig) -> None:
    rig.fail = {"init": CommandError("gain kp must be positive")}
    with pytest.raises(HricError, match="controller left cannot be loaded: gain kp must be positive"):
        rig.load("left")
    assert rig.states() == {}


def test_a_programming_error_in_init_is_told_with_its_place(rig) -> None:
    rig.fail = {"init": ZeroDivisionError("division by zero")}
    with pytest.raises(
        HricError,
        match=r"left cannot be loaded: ZeroDivisionError: division by zero \(.*recorded_calls\.py:\d+\)",
    ):
        rig.load("left")


def test_an_unknown_joint_is_refused_with_the_joints_that_exist(rig) -> None:
    rig.node.set_param("left/joints", ["elbow"])
    with pytest.raises(HricError, match="no joint 'elbow' in EffortJointInterface; valid: joint1, joint2"):
        rig.load("left")


class Talkative(Controller):
    """Controller that offers topics and a service and does not unregister them."""

    def init(self, robot_hw, root_node, controller_node) -> None:
        robot_hw.get(EffortJointInterface).group()
        controller_node.advertise("state", Float64)
        controller_node.subscribe("command", Float64, print)
        root_node.advertise("joint_states", Float64)
        controller_node.child("deeper").service("reset", Empty, lambda request: Empty._response_class())
        if controller_node.param("broken", False):
            raise HricError("broken")


@pytest.mark.parametrize("broken", [True, False])
def test_what_a_controller_offered_is_gone_after_unload_and_after_a_failed_init(broken: bool) -> None:
    node = LocalNode({"talk": {"type": "t", "broken": broken}})
    manager = ControllerManager(RecordingRobotHW(), node, {"t": Talkative})
    if broken:
        with pytest.raises(HricError, match="broken"):
            manager.load("talk")
    else:
        manager.load("talk")
        assert set(node.topics()) == {"/talk/state", "/talk/command", "/joint_states"} and set(node.services()) == {
            "/talk/deeper/reset"
        }
        manager.unload("talk")
    assert node.topics() == {} and node.services() == {}
    node.set_param("talk/broken", False)
    manager.load("talk")


def test_claims_of_a_controller_that_failed_do_not_count_for_the_next(rig) -> None:
    rig.fail = {"init": HricError("no")}
    with pytest.raises(HricError):
        rig.load("both")
    rig.fail = {}
    rig.load("left")
    assert rig.manager.list()[0].claims == {"hardware_interface::EffortJointInterface": ("joint1",)}


def test_a_running_controller_cannot_be_unloaded(rig) -> None:
    rig.start("left")
    with pytest.raises(HricError, match="left cannot be unloaded: it is running; stop it first"):
        rig.manager.unload("left")


def test_unloading_what_is_not_loaded_tells_what_is(rig) -> None:
    rig.load("left")
    with pytest.raises(UnknownNameError, match="no controller 'right' in the manager, to unload; valid: left"):
        rig.manager.unload("right")


def test_an_unloaded_controller_was_shut_down_and_can_be_loaded_again(rig) -> None:
    rig.start("left")
    rig.manager.switch([], ["left"])
    rig.manager.unload("left")
    assert rig.made["left"].calls == ["init", "starting", "stopping", "shutdown"]
    rig.load("left")
    assert rig.states() == {"left": "initialized"}


def test_an_error_in_shutdown_is_logged_and_the_controller_is_gone(rig, caplog: pytest.LogCaptureFixture) -> None:
    rig.fail = {"shutdown": ValueError("late")}
    rig.load("left")
    rig.manager.unload("left")
    assert rig.states() == {} and "controller left failed in shutdown: ValueError: late" in caplog.text


def test_the_types_are_those_of_packages_and_those_given_by_hand(rig) -> None:
    types = rig.manager.types()
    assert types["fake/Controller"] == types["hric_controllers/JointPDController"] == "hric_control::Controller"


def test_reloading_is_refused_while_controllers_are_loaded_unless_they_may_be_killed(
    rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    reloaded = []
    monkeypatch.setattr(plugins, "reload", lambda base: reloaded.append(base) or [])
    rig.start("left")
    with pytest.raises(HricError, match=r"controllers are loaded \(left\)"):
        rig.manager.reload()
    assert reloaded == []
    rig.manager.reload(force_kill=True)
    assert reloaded == ["hric_control::Controller"] and rig.states() == {}
    assert rig.made["left"].calls[-2:] == ["stopping", "shutdown"]


def test_shutting_the_manager_down_stops_and_unloads_everything(rig) -> None:
    rig.load("right")
    rig.start("left")
    rig.manager.shutdown()
    assert rig.states() == {}
    assert rig.made["left"].calls[-2:] == ["stopping", "shutdown"] and rig.made["right"].calls[-1] == "shutdown"


def test_a_fake_controller_is_a_controller() -> None:
    assert issubclass(FakeController, Controller)


class Lazy(Controller):
    """Controller that reads a number, a group of parameters and a number in a group, and asks if a parameter exists."""

    def init(self, robot_hw, root_node, controller_node) -> None:
        self.values = [controller_node.param(name, 0.0) for name in ("gain", "limits", "filter/time")]
        self.switch = controller_node.has_param("switch")


def loaded(**parameters) -> ControllerManager:
    manager = ControllerManager(
        RecordingRobotHW(), LocalNode({"a": {"type": "t/Lazy", **parameters}}), classes={"t/Lazy": Lazy}
    )
    manager.load("a")
    return manager


def test_parameters_that_a_controller_reads_by_itself_are_accepted() -> None:
    assert loaded(gain=1.0, limits={"lower": 0.0}, filter={"time": 0.1}, switch=True).list()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gian": 1.0}, r"no parameter 'gian' in /a; valid: .*gain.*\(did you mean gain\?\)"),
        ({"filter": {"tme": 0.1}}, r"no parameter 'tme' in /a/filter; valid: time \(did you mean time\?\)"),
        ({"gains": {"p": 1.0}}, r"no parameter 'gains' in /a; .*did you mean gain"),
        ({"x": 1, "y": 2}, r"2 mistakes\n.*'x'.*\n.*'y'"),
    ],
)
def test_a_parameter_that_a_controller_never_reads_is_refused_with_the_nearest_one(given, message) -> None:
    with pytest.raises(HricError, match=message):
        loaded(**given)


def test_a_controller_refused_for_a_parameter_leaves_nothing_behind() -> None:
    node = LocalNode({"a": {"type": "t/Talkative", "chat": 1}})
    manager = ControllerManager(RecordingRobotHW(), node, classes={"t/Talkative": Talkative})
    before = (node.topics(), node.services())
    with pytest.raises(HricError, match="no parameter 'chat'"):
        manager.load("a")
    assert (node.topics(), node.services(), manager.list()) == (*before, [])
