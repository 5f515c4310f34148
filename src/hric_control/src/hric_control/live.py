"""Parameters that change while running, without ROS: checking a change, asking the owner, putting back what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from hric_control.errors import ParameterError, UnknownNameError
from hric_control.node import LiveParameter

OnChange = Callable[[dict[str, Any]], dict[str, Any]]


class LiveValues:
    """The values of a set of live parameters. A change is taken as a whole or refused as a whole.

    Args:
        namespace: for messages.
        parameters: what there is; a range is in force where `minimum` < `maximum`.
        on_change: gets all values, returns those in force.
        initial: values that replace the defaults, e.g. from the parameter server.

    Raises:
        ParameterError: an initial value is of the wrong type or out of range.
        HricError: whatever `on_change` raises for the initial values.
    """

    def __init__(self, namespace: str, parameters: Sequence[LiveParameter], on_change: OnChange, initial: Mapping[str, Any]) -> None:
        self._namespace = namespace
        self._parameters = {parameter.name: parameter for parameter in parameters}
        self._on_change = on_change
        self.values: dict[str, Any] = {p.name: p.default for p in parameters}
        self._apply(initial)

    def change(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Apply changes and return all values then in force.

        Raises:
            UnknownNameError: a name that is not among the parameters.
            HricError: a value of the wrong type, out of range, or refused by the owner; nothing changed then.
        """
        self._apply(changes)
        return dict(self.values)

    def _apply(self, changes: Mapping[str, Any]) -> None:
        wanted = dict(self.values)
        for name, value in changes.items():
            if name not in self._parameters:
                raise UnknownNameError("live parameter", name, self._parameters, self._namespace)
            wanted[name] = self._checked(self._parameters[name], value)
        in_force = self._on_change(dict(wanted))
        self.values = {name: in_force.get(name, wanted[name]) for name in self._parameters}

    def _checked(self, parameter: LiveParameter, value: Any) -> Any:
        kind = type(parameter.default)
        name = f"{self._namespace.rstrip('/')}/{parameter.name}"
        # An int is a fair float; a bool is an int to Python but not to a user.
        if kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if type(value) is not kind:
            raise ParameterError(f"{name} must be of type {kind.__name__}, not {type(value).__name__} ({value!r})")
        if kind in (int, float):
            _check_range(name, parameter, value)
        return value


def _check_range(name: str, parameter: LiveParameter, value: Any) -> None:
    if not math.isfinite(value):
        raise ParameterError(f"{name} must be finite, not {value}")
    if parameter.minimum < parameter.maximum and not parameter.minimum <= value <= parameter.maximum:
        raise ParameterError(f"{name} must be within {parameter.minimum:g} to {parameter.maximum:g}, not {value:g}")
