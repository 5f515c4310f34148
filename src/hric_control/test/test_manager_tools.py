"""The manager on rospy, used by ROS's own tools and by spawner, unspawner and controller_manager."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
import rospy
import yaml
from std_msgs.msg import Bool

from controller_manager_msgs.msg import ControllersStatistics, ControllerState
from controller_manager_msgs.srv import ListControllers, SwitchController
from hric_control.manager import command as manager_cli
from hric_control.manager.client import ManagerClient
from hric_control.manager.spawner import Spawner, Unspawner, run_spawner, run_unspawner
from hric_core.errors import HricError

pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

NAMESPACE = "/arm"
NOWHERE = "http://127.0.0.1:9"
TOOLS = Path(__file__).parents[2] / "controller_manager" / "nodes"
CONFIGURATION = {
    "left": {"type": "fake/Controller", "joints": ["joint1"]},
    "both": {"type": "fake/Controller", "joints": ["joint1", "joint2"]},
    "bad": {"type": "fake/Controller", "joints": ["elbow"]},
}


def wait(condition: Callable[[], object], timeout: float = 30.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def begin(*command: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def end(process: subprocess.Popen[str]) -> tuple[int, str]:
    process.send_signal(signal.SIGINT)
    try:
        output, _ = process.communicate(timeout=30)
    except subprocess.TimeoutExpired:
        process.kill()
        raise
    return process.returncode, output


def tool(name: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(TOOLS / name), *arguments],
        capture_output=True,
        text=True,
        timeout=30,
        env={**os.environ, **environment},
    )


def call(name: str, service_type: Any, **fields: Any) -> Any:
    return rospy.ServiceProxy(f"{NAMESPACE}/controller_manager/{name}", service_type)(**fields)


def states() -> dict[str, str]:
    return {c.name: c.state for c in call("list_controllers", ListControllers).controller}


def rosservice(name: str, request: str) -> dict:
    output = subprocess.run(
        ["rosservice", "call", f"{NAMESPACE}/controller_manager/{name}", request],
        check=True,
        capture_output=True,
        text=True,
        timeout=30,
    ).stdout
    return yaml.safe_load(output)


@pytest.fixture(scope="module")
def robot(ros: str) -> Iterator[None]:
    rospy.set_param(NAMESPACE, CONFIGURATION)
    process = begin(str(Path(__file__).with_name("fake_robot_node.py")), NAMESPACE)
    rospy.wait_for_service(f"{NAMESPACE}/controller_manager/switch_controller", timeout=20.0)
    yield
    code, output = end(process)
    assert code == 0 and "Traceback" not in output


@pytest.fixture
def client(robot: None) -> Iterator[ManagerClient]:
    client = ManagerClient(NAMESPACE)
    yield client
    client.reload(force_kill=True)
    assert states() == {}


def test_plain_rosservice_calls_load_start_and_list(client: ManagerClient) -> None:
    assert rosservice("load_controller", "name: left") == {"ok": True}
    assert rosservice("switch_controller", "{start_controllers: [left], strictness: 2}") == {"ok": True}
    (entry,) = rosservice("list_controllers", "{}")["controller"]
    assert (entry["name"], entry["state"]) == ("left", "running")
    assert entry["claimed_resources"] == [
        {"hardware_interface": "hardware_interface::EffortJointInterface", "resources": ["joint1"]}
    ]


def test_statistics_are_published(client: ManagerClient) -> None:
    message = rospy.wait_for_message(f"{NAMESPACE}/controller_manager/statistics", ControllersStatistics, timeout=10.0)
    assert message.header.stamp.to_sec() > 0.0


def test_the_tool_lists_starts_stops_and_kills(client: ManagerClient, capsys: pytest.CaptureFixture[str]) -> None:
    def run(*arguments: str) -> str:
        assert manager_cli.run(["--namespace", NAMESPACE, *arguments]) == 0
        return capsys.readouterr().out

    assert run("list") == "no controllers are loaded\n"
    run("spawn", "left")
    assert run("list") == "left - fake/Controller ( running ) claims hardware_interface::EffortJointInterface: joint1\n"
    run("stop", "left")
    assert states() == {"left": "stopped"}
    run("start", "left")
    run("kill", "left")
    assert states() == {}
    run("load", "both")
    run("unload", "both")
    assert "fake/Controller [hric_control::Controller]" in run("list-types")


def test_the_tool_takes_its_namespace_from_ros(client: ManagerClient) -> None:
    client.load("left")
    assert "left - fake/Controller ( initialized )" in tool("controller_manager", "list", f"__ns:={NAMESPACE}").stdout


def test_the_tool_reloads_and_restores(client: ManagerClient) -> None:
    for name in ("left", "both"):
        client.load(name)
    client.switch(["both"], [])
    assert manager_cli.run(["--namespace", NAMESPACE, "reload-libraries", "--restore"]) == 0
    assert states() == {"left": "initialized", "both": "running"}


@pytest.mark.parametrize("command", ["load", "unload", "start", "stop"])
def test_what_the_manager_refuses_is_an_error_and_a_failing_exit(
    client: ManagerClient, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert manager_cli.run(["--namespace", NAMESPACE, command, "absent"]) == 1
    error = capsys.readouterr().err
    assert re.search(r"absent.*: controller absent has no type|no controller 'absent'.*; valid", error), error


def test_a_spawner_starts_controllers_and_takes_them_down_on_ctrl_c(client: ManagerClient, tmp_path: Path) -> None:
    (tmp_path / "more.yaml").write_text("filed: {type: fake/Controller, joints: [joint2]}\n")
    publisher = rospy.Publisher("/go", Bool, queue_size=1, latch=True)
    publisher.publish(False)
    arguments = (
        "--namespace",
        NAMESPACE,
        "--wait-for",
        "/go",
        "left",
        str(tmp_path / "more.yaml"),
        "__name:=my_spawner",
    )
    spawner = begin(str(TOOLS / "spawner"), *arguments)
    assert wait(publisher.get_num_connections)
    time.sleep(0.2)
    assert states() == {}
    publisher.publish(True)
    assert wait(lambda: states() == {"left": "running", "filed": "running"})
    code, output = end(spawner)
    assert code == 0 and "Traceback" not in output and states() == {}
    publisher.unregister()


def test_a_stopped_spawner_loads_only(client: ManagerClient) -> None:
    spawner = Spawner(client)
    spawner.up(["left", "both"], start=False)
    assert states() == {"left": "initialized", "both": "initialized"}
    spawner.down()
    assert states() == {}


def test_a_spawner_that_cannot_start_all_unloads_all_and_says_why(client: ManagerClient) -> None:
    with pytest.raises(HricError, match="could not start left, both"):
        Spawner(client).up(["left", "both"], start=True)
    assert states() == {}
    with pytest.raises(HricError, match="bad could not be loaded"):
        Spawner(client).up(["left", "bad"], start=True)
    assert states() == {}


def test_a_spawner_uses_what_is_loaded_already_and_leaves_it_loaded(client: ManagerClient) -> None:
    client.load("left")
    spawner = Spawner(client)
    spawner.up(["left"], start=True)
    assert states() == {"left": "running"}
    spawner.down()
    assert states() == {"left": "stopped"}


def test_an_unspawner_keeps_controllers_stopped_and_starts_them_again_at_its_end(client: ManagerClient) -> None:
    client.load("left")
    client.switch(["left"], [])
    unspawner = begin(str(TOOLS / "unspawner"), "--namespace", NAMESPACE, "left")
    assert wait(lambda: states() == {"left": "stopped"})
    code, output = end(unspawner)
    assert code == 0 and "Traceback" not in output and states() == {"left": "running"}


class SlowClient:
    """Manager client whose switches take effect at once but return late."""

    def __init__(self) -> None:
        self.running = {"left"}
        self.switching = threading.Event()
        self.answer = threading.Event()

    def list(self) -> list[ControllerState]:
        return [ControllerState(name="left", state="running" if "left" in self.running else "stopped")]

    def load(self, name: str) -> None:
        self.switching.set()
        assert self.answer.wait(10)

    def unload(self, name: str) -> None:
        self.unloaded = name

    def switch(self, start: Sequence[str], stop: Sequence[str], strictness: int = 0) -> None:
        self.running = (self.running | set(start)) - set(stop)
        self.switching.set()
        assert self.answer.wait(10)


def in_the_middle(client: SlowClient, work: Callable[[], None], end: Callable[[], None]) -> None:
    """Begin `end` while `work` waits for the manager's response, then let the response arrive."""
    working, ending = threading.Thread(target=work), threading.Thread(target=end)
    working.start()
    assert client.switching.wait(10)
    ending.start()
    ending.join(0.1)
    client.answer.set()
    for thread in (working, ending):
        thread.join(10)
        assert not thread.is_alive()


def test_an_unspawner_ended_in_the_middle_of_a_stop_starts_the_controller_again() -> None:
    client = SlowClient()
    unspawner = Unspawner(client, ["left"])  # type: ignore[arg-type]
    in_the_middle(client, unspawner.hold, unspawner.release)
    assert client.running == {"left"}


def test_a_spawner_ended_in_the_middle_of_a_load_leaves_nothing_loaded() -> None:
    client = SlowClient()
    spawner = Spawner(client)  # type: ignore[arg-type]

    def up() -> None:
        with pytest.raises(HricError, match="interrupted before all controllers were loaded"):
            spawner.up(["more"], start=True)

    in_the_middle(client, up, spawner.down)
    assert client.unloaded == "more" and client.running == {"left"}


def test_a_switch_while_the_loop_is_paused_is_refused_and_not_made_later(client: ManagerClient) -> None:
    client.load("left")
    rospy.set_param("/paused", True)
    time.sleep(1.0)
    assert not call("switch_controller", SwitchController, start_controllers=["left"], strictness=2).ok
    rospy.set_param("/paused", False)
    time.sleep(0.3)
    assert states() == {"left": "initialized"}


def test_without_the_services_a_spawner_ends_in_time_and_says_what_is_missing(ros: str) -> None:
    result = tool("spawner", "--timeout", "0.6", "--namespace", "/nowhere", "left")
    assert (
        result.returncode == 1 and "no service /nowhere/controller_manager/load_controller after 0.6 s" in result.stderr
    )


@pytest.mark.parametrize("name", ["spawner", "unspawner", "controller_manager"])
def test_help_comes_without_a_master(name: str) -> None:
    assert "usage" in tool(name, "--help", ROS_MASTER_URI=NOWHERE).stdout


@pytest.mark.parametrize("run", [manager_cli.run, run_spawner, run_unspawner])
def test_without_a_master_a_tool_fails_at_once_and_says_so(
    run: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", NOWHERE)
    assert run(["list"]) == 1
    assert f"no ROS master at {NOWHERE}" in capsys.readouterr().err
