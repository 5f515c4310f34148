"""Live parameters on dynamic_reconfigure, declared in the program instead of a .cfg file.

Services, topics and tools such as rqt_reconfigure are those of dynamic_reconfigure."""

import math
import threading
from collections.abc import Callable, Sequence
from typing import Any

import roslib.launcher
import rospy

from hric_core.errors import HricError
from hric_core.live import LiveValues
from hric_core.node import LiveParameter, OnChange

# Importing dynamic_reconfigure queries rospack for Python paths, which only packages older than catkin need, and
# rospack complains about rosdep.
roslib.launcher._bootstrapped.append("dynamic_reconfigure")
from dynamic_reconfigure.server import Server  # noqa: E402

_WIRE_TYPE = {bool: "bool", int: "int", float: "double", str: "str"}
_INT_RANGE = (-(2**31), 2**31 - 1)


class ConfigType:
    """Replacement of the `<Name>Config` module that dynamic_reconfigure generates, built from a list of parameters."""

    def __init__(self, parameters: Sequence[LiveParameter]) -> None:
        self.defaults: dict[str, object] = {p.name: p.default for p in parameters}
        self.min: dict[str, object] = {p.name: _bounds(p)[0] for p in parameters}
        self.max: dict[str, object] = {p.name: _bounds(p)[1] for p in parameters}
        self.config_description: dict[str, object] = {
            "name": "Default",
            "type": "",
            "state": True,
            "cstate": "true",
            "id": 0,
            "parent": 0,
            "parentname": "",
            "parentclass": "",
            "class": "DEFAULT",
            "field": "default",
            "upper": "DEFAULT",
            "lower": "groups",
            "groups": [],
            "parameters": [self._describe(p) for p in parameters],
        }

    def _describe(self, parameter: LiveParameter) -> dict[str, object]:
        low, high = _bounds(parameter)
        return {
            "name": parameter.name,
            "type": _WIRE_TYPE[type(parameter.default)],
            "default": parameter.default,
            "min": low,
            "max": high,
            "level": 0,
            "description": parameter.description,
            "edit_method": "",
        }


def _bounds(parameter: LiveParameter) -> tuple[Any, Any]:
    kind = type(parameter.default)
    if kind is bool:
        return False, True
    if kind is str:
        return "", ""
    if parameter.minimum < parameter.maximum:
        return kind(parameter.minimum), kind(parameter.maximum)
    return _INT_RANGE if kind is int else (-math.inf, math.inf)


class _Server(Server):
    """Server of dynamic_reconfigure that refuses values out of range instead of clamping them."""

    def _clamp(self, config: Any) -> None:
        """Leave the values unchanged: a gain of -5 must be refused, not silently become 0."""


class RosLiveParameters:
    """dynamic_reconfigure server for live parameters in a namespace.

    Args:
        namespace: absolute name of the namespace.
        parameters: the live parameters.
        on_change: callback with all requested values that returns those then in force; it refuses by a HricError.
        report: function that logs a line of error text.

    Raises:
        HricError: the values on the parameter server, or the defaults, are refused.
    """

    def __init__(
        self,
        namespace: str,
        parameters: Sequence[LiveParameter],
        on_change: OnChange,
        report: Callable[[str], None],
    ) -> None:
        self._report = report
        initial = {
            p.name: rospy.get_param(f"{namespace}/{p.name}")
            for p in parameters
            if rospy.has_param(f"{namespace}/{p.name}")
        }
        self._live = LiveValues(namespace, parameters, on_change, initial)
        self._names = tuple(self._live.values)
        for name, value in self._live.values.items():  # the server reads back complete values of the right type
            rospy.set_param(f"{namespace}/{name}", value)
        self._lock = threading.Lock()
        self._first = True
        self._server = _Server(ConfigType(parameters), self._change, namespace)

    def close(self) -> None:
        """Unregister the services and topics."""
        self._server.set_service.shutdown("unregistered")
        self._server.descr_topic.unregister()
        self._server.update_topic.unregister()

    def _change(self, config: Any, level: int) -> Any:
        with self._lock:
            if not self._first:
                try:
                    self._live.change({name: config[name] for name in self._names})
                except HricError as error:
                    self._report(str(error))
            self._first = False
            config.update(self._live.values)
            return config
