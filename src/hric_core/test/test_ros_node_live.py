import subprocess
import time
from collections.abc import Callable

import dynamic_reconfigure.client
import pytest
import rospy
import yaml

from hric_core.errors import ParameterError
from hric_core.node import LiveParameter
from hric_core.ros import RosNode

pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

PARAMETERS = [
    LiveParameter("kp", 50.0, 0.0, 1000.0, "gain [N m/rad]"),
    LiveParameter("count", 3, 1, 5),
    LiveParameter("on", True),
    LiveParameter("mode", "soft", description="soft or hard"),
    LiveParameter("free", 0.5),
]
START = {"kp": 50.0, "count": 3, "on": True, "mode": "soft", "free": 0.5}


class Owner:
    """Owner of live parameters that records requests and refuses kp above 100."""

    def __init__(self, namespace: str) -> None:
        self.asked: list[dict] = []
        self.errors: list[str] = []
        self.node = RosNode(namespace)
        self.node.log_error = self.errors.append  # type: ignore[method-assign]
        self.registration = self.node.live_parameters(PARAMETERS, self._change)

    def _change(self, values: dict) -> dict:
        self.asked.append(dict(values))
        return {**values, "kp": min(values["kp"], 100.0)}


@pytest.fixture
def owner(ros: str, request: pytest.FixtureRequest):
    owner = Owner(f"/live/{request.node.name[:30].split('[')[0]}")
    yield owner
    owner.registration.unregister()


def dynparam(*arguments: str) -> str:
    return subprocess.run(
        ["rosrun", "dynamic_reconfigure", "dynparam", *arguments],
        check=True,
        capture_output=True,
        text=True,
        timeout=30,
    ).stdout


def values_at(client: dynamic_reconfigure.client.Client) -> dict:
    return {name: value for name, value in client.get_configuration(timeout=30.0).items() if name != "groups"}


def wait(condition: Callable[[], object], timeout: float = 30.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def test_the_dynparam_tool_gets_and_sets_all_types(owner: Owner) -> None:
    got = yaml.safe_load(dynparam("get", owner.node.namespace))
    assert {name: got[name] for name in START} == START
    dynparam("set", owner.node.namespace, "{kp: 70, count: 4, 'on': false, mode: hard}")
    assert owner.asked[-1] == {"kp": 70.0, "count": 4, "on": False, "mode": "hard", "free": 0.5}
    assert owner.node.param("kp") == 70.0


def test_values_on_the_parameter_server_replace_the_defaults(ros: str) -> None:
    rospy.set_param("/live/preset/kp", 60)
    owner = Owner("/live/preset")
    assert owner.asked[0] == {**START, "kp": 60.0}
    owner.registration.unregister()


def test_a_value_that_the_owner_puts_back_is_what_clients_see(owner: Owner) -> None:
    client = dynamic_reconfigure.client.Client(owner.node.namespace, timeout=30.0)
    assert client.update_configuration({"kp": 500.0})["kp"] == 100.0
    assert wait(lambda: values_at(client)["kp"] == 100.0) and owner.node.param("kp") == 100.0
    client.close()


@pytest.mark.parametrize("kp", [-5.0, float("nan")])
def test_a_bad_value_is_one_error_and_nothing_changes(owner: Owner, kp: float) -> None:
    client = dynamic_reconfigure.client.Client(owner.node.namespace, timeout=30.0)
    answer = client.update_configuration({"mode": "hard", "kp": kp})
    assert (answer["kp"], answer["mode"]) == (50.0, "soft") and len(owner.asked) == 1
    assert owner.errors == [f"{owner.node.namespace}/kp is {kp}; valid: a finite number from 0 to 1000"]
    assert owner.node.param("mode") == "soft"
    client.close()


def test_a_bad_value_on_the_parameter_server_is_refused_at_once(ros: str) -> None:
    rospy.set_param("/live/bad/kp", -1.0)
    with pytest.raises(ParameterError, match=r"/live/bad/kp is -1.0; valid: a finite number from 0 to 1000"):
        Owner("/live/bad")


def test_descriptions_give_ranges_and_texts(owner: Owner) -> None:
    client = dynamic_reconfigure.client.Client(owner.node.namespace, timeout=30.0)
    described = {entry["name"]: entry for entry in client.get_parameter_descriptions(timeout=30.0)}
    assert (described["kp"]["min"], described["kp"]["max"], described["kp"]["description"]) == (
        0.0,
        1000.0,
        "gain [N m/rad]",
    )
    assert [described[name]["type"] for name in START] == ["double", "int", "bool", "str", "double"]
    client.close()


def test_taken_back_the_service_is_gone_and_can_be_offered_again(owner: Owner) -> None:
    owner.registration.unregister()
    with pytest.raises(rospy.ROSException):
        rospy.wait_for_service(f"{owner.node.namespace}/set_parameters", timeout=0.2)
    owner.registration = owner.node.live_parameters(PARAMETERS, lambda values: values)
    rospy.wait_for_service(f"{owner.node.namespace}/set_parameters", timeout=30.0)
