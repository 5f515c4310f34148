"""Spawner node: sets the parameters of an experiment, loads its controllers and starts them together."""

import time
from dataclasses import dataclass
from typing import Any

import rospy

from controller_manager_msgs.srv import ListControllers, LoadController, SwitchController, SwitchControllerRequest
from franka_msgs.srv import SetLoad
from hric_control.manager.services import REFUSAL
from hric_core.errors import FailureError
from hric_core.parameters import Settings, text
from hric_core.ros import RosNode
from hric_experiments.live import node as live_node
from hric_run.definition import experiment as experiments
from hric_run.definition import overrides, parameters
from hric_run.definition.experiment import Experiment

READY_TIMEOUT = 60.0
"""Maximum wait for the controller manager of the robot [s of wall time]."""
MANAGER = "controller_manager"


class SpawnError(FailureError):
    """Error: controllers could not be started; the log of the robot node contains the reason."""


def configure(definition: Experiment) -> None:
    """Set the experiment's controller parameters on the parameter server; add missing controllers.

    For a robot that is no Franka arm, they replace those of controllers.yaml, which the bring-up loads.
    """
    configured = parameters.controllers(definition)
    for name in definition.controllers:
        present = None if definition.robot.urdf else rospy.get_param(name, None)
        changes = configured[name] if present is None else definition.parameters.get(name, {})
        rospy.set_param(name, parameters.overlay(present or {}, changes))


def start(definition: Experiment, timeout: float = READY_TIMEOUT) -> None:
    """Load the experiment's controllers that are not loaded yet, and start all of them in one switch.

    Raises:
        SpawnError: the controller manager does not respond, or rejects a request.
    """
    _wait_for_manager(timeout)
    loaded = {controller.name: controller.state for controller in _call("list_controllers", ListControllers).controller}
    for name in definition.controllers:
        if name not in loaded and not _call("load_controller", LoadController, name=name).ok:
            raise SpawnError(f"controller {name} could not be loaded: {_reason()}")
    _set_load(definition)
    waiting = [name for name in definition.controllers if loaded.get(name) != "running"]
    request = {"start_controllers": waiting, "stop_controllers": [], "strictness": SwitchControllerRequest.STRICT}
    if waiting and not _call("switch_controller", SwitchController, **request).ok:
        raise SpawnError(f"controllers {', '.join(waiting)} could not be started: {_reason()}")


def _set_load(definition: Experiment) -> None:
    """Set the payload of the experiment; an arm accepts it only while no controller moves it."""
    request = parameters.load_request(definition.robot)
    if request is None:
        return
    try:
        response = rospy.ServiceProxy(parameters.LOAD_SERVICE, SetLoad)(request)
    except rospy.ServiceException as error:
        raise SpawnError(f"{parameters.LOAD_SERVICE}: {error}") from error
    if not response.success:
        raise SpawnError(f"the robot rejected the payload robot.load: {response.error}")


def load_others(definition: Experiment) -> None:
    """Load all other configured controllers without starting them, so that one call can switch to any of them.

    Raises:
        SpawnError: the controller manager rejects a request.
    """
    for name in parameters.defaults(definition.robot.arm_id):
        if name not in definition.controllers and not _call("load_controller", LoadController, name=name).ok:
            raise SpawnError(f"controller {name} could not be loaded: {_reason()}")


def _wait_for_manager(timeout: float) -> None:
    deadline = time.monotonic() + timeout
    while not rospy.is_shutdown():
        try:
            rospy.wait_for_service(f"{MANAGER}/switch_controller", 0.2)
            return
        except rospy.ROSException as error:
            if time.monotonic() > deadline:
                raise SpawnError(
                    f"the controller manager {rospy.resolve_name(MANAGER)} does not respond after {timeout:g} s"
                ) from error


def _reason() -> str:
    return str(rospy.get_param(f"{MANAGER}/{REFUSAL}", "see the log of the robot node for the reason"))


def _call(service: str, service_type: type, **request: Any) -> Any:
    try:
        return rospy.ServiceProxy(f"{MANAGER}/{service}", service_type)(**request)
    except rospy.ServiceException as error:
        raise SpawnError(f"{MANAGER}/{service}: {error}") from error


@dataclass(frozen=True)
class SpawnerSettings(Settings):
    """Parameters of the spawner node."""

    experiment: str = text("", default_text="none", text="experiment whose controllers are started")
    overrides: str = text("", figures=True, text="overrides of the experiment")


def run() -> None:
    """Start the controllers of the experiment that the private parameters select, then wait for the shutdown."""
    settings = SpawnerSettings.read(RosNode("~"))
    definition = experiments.load(settings.experiment or experiments.NONE, overrides.separate(settings.overrides))
    configure(definition)
    start(definition)
    rospy.loginfo("started the controllers %s", ", ".join(definition.controllers))
    if definition.name == experiments.NONE:
        load_others(definition)
    rospy.set_param("~started", list(definition.controllers))
    while not rospy.is_shutdown():
        live_node.sleep(0.05)
