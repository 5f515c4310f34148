"""Spawner node: sets the parameters of an experiment, loads its controllers and starts them together."""

import time
from collections.abc import Mapping
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
    """Set the parameters of the experiment's controllers, and those outside them, on the parameter server.

    For several arms, and for a robot that is no Franka arm, they replace those that the bring-up loads.
    """
    for name, value in definition.global_parameters.items():
        rospy.set_param(name, value)
    for prefix, part in definition.robots().items():
        configured = parameters.controllers(part)
        for name in part.controllers:
            present = None if part.robot.urdf or part.arms else rospy.get_param(f"{prefix}{name}", None)
            changes = configured[name] if present is None else part.parameters.get(name, {})
            rospy.set_param(f"{prefix}{name}", _without_null(parameters.overlay(present or {}, changes)))


def _without_null(values: Mapping[str, object]) -> dict[str, object]:
    """Return parameters without those that are null, which the parameter server cannot hold."""
    present = {key: value for key, value in values.items() if value is not None}
    return {key: _without_null(value) if isinstance(value, Mapping) else value for key, value in present.items()}


def start(definition: Experiment, timeout: float = READY_TIMEOUT) -> None:
    """Load the experiment's controllers that are not loaded yet, and start those of each manager in one switch.

    Raises:
        SpawnError: a controller manager does not respond, or rejects a request.
    """
    for prefix, part in definition.robots().items():
        _start(part, _Manager(prefix), timeout)


def _start(definition: Experiment, manager: "_Manager", timeout: float) -> None:
    manager.wait(timeout)
    listed = manager.call("list_controllers", ListControllers).controller
    loaded = {controller.name: controller.state for controller in listed}
    for name in definition.controllers:
        if name not in loaded:
            manager.load(name)
    if not definition.arms:
        _set_load(definition, manager.prefix)
    waiting = [name for name in definition.controllers if loaded.get(name) != "running"]
    request = {"start_controllers": waiting, "stop_controllers": [], "strictness": SwitchControllerRequest.STRICT}
    if waiting and not manager.call("switch_controller", SwitchController, **request).ok:
        raise SpawnError(f"controllers {', '.join(waiting)} could not be started: {manager.reason()}")


def _set_load(definition: Experiment, prefix: str) -> None:
    """Set the payload of the experiment; an arm accepts it only while no controller moves it."""
    request = parameters.load_request(definition.robot)
    if request is None:
        return
    try:
        response = rospy.ServiceProxy(f"{prefix}{parameters.LOAD_SERVICE}", SetLoad)(request)
    except rospy.ServiceException as error:
        raise SpawnError(f"{prefix}{parameters.LOAD_SERVICE}: {error}") from error
    if not response.success:
        raise SpawnError(f"the robot rejected the payload {prefix}robot.load: {response.error}")


def load_others(definition: Experiment) -> None:
    """Load all other configured controllers without starting them, so that one call can switch to any of them.

    Raises:
        SpawnError: a controller manager rejects a request.
    """
    for prefix, part in definition.robots().items():
        manager = _Manager(prefix)
        for name, values in parameters.defaults(*(part.arms or [part.robot.arm_id])).items():
            if name not in part.controllers:
                if prefix or part.arms:  # those of the only arm are parameters of the bring-up
                    rospy.set_param(f"{prefix}{name}", values)
                if not part.arms or "joints" in values:  # a controller of an end effector has one arm
                    manager.load(name)


class _Manager:
    """Client of a controller manager; `prefix`: namespace of an arm with a slash at its end, or empty."""

    def __init__(self, prefix: str) -> None:
        self.prefix, self._name = prefix, f"{prefix}{MANAGER}"

    def wait(self, timeout: float) -> None:
        """Wait until the manager responds, at most `timeout` [s of wall time]."""
        deadline = time.monotonic() + timeout
        while not rospy.is_shutdown():
            try:
                rospy.wait_for_service(f"{self._name}/switch_controller", 0.2)
                return
            except rospy.ROSException as error:
                if time.monotonic() > deadline:
                    raise SpawnError(
                        f"the controller manager {rospy.resolve_name(self._name)} does not respond after {timeout:g} s"
                    ) from error

    def load(self, name: str) -> None:
        """Load a controller."""
        if not self.call("load_controller", LoadController, name=name).ok:
            raise SpawnError(f"controller {self.prefix}{name} could not be loaded: {self.reason()}")

    def reason(self) -> str:
        """Return the reason of the last refusal."""
        return str(rospy.get_param(f"{self._name}/{REFUSAL}", "see the log of the robot node for the reason"))

    def call(self, service: str, service_type: type, **request: Any) -> Any:
        """Call a service of the manager."""
        try:
            return rospy.ServiceProxy(f"{self._name}/{service}", service_type)(**request)
        except rospy.ServiceException as error:
            raise SpawnError(f"{self._name}/{service}: {error}") from error


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
    started = [f"{prefix}{name}" for prefix, part in definition.robots().items() for name in part.controllers]
    rospy.loginfo("started the controllers %s", ", ".join(started))
    if definition.name == experiments.NONE and not definition.robot.urdf:  # the others are for an arm of Franka
        load_others(definition)
    rospy.set_param("~started", started)
    while not rospy.is_shutdown():
        live_node.sleep(0.05)
