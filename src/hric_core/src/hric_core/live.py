"""Live parameters, which can change while a program runs: a change is checked and passed to their owner. No ROS."""

from collections.abc import Callable, Mapping, Sequence

from hric_core.errors import check_known
from hric_core.node import LiveParameter, OnChange, ParameterValues
from hric_core.parameters import Parameter, Settings, declared, flag, number, text, whole

_KINDS: dict[type, Callable[..., Parameter]] = {bool: flag, int: whole, float: number, str: text}


def live_parameters(settings: Settings) -> list[LiveParameter]:
    """Return the parameters of `settings` that are declared as live, with their present values as defaults."""
    return [
        LiveParameter(
            parameter.name, getattr(settings, key), parameter.minimum, parameter.maximum, parameter.text_with_unit
        )
        for key, parameter in declared(type(settings)).items()
        if parameter.live
    ]


class LiveValues:
    """Values of a set of live parameters. A change of several values is accepted or refused as a whole.

    Args:
        namespace: namespace of the parameters, for error messages.
        parameters: the live parameters; one has a range if its `minimum` < `maximum`.
        on_change: callback of the owner; gets all requested values and returns the values then in force.
        initial: values that replace the defaults, e.g. from the parameter server.

    Raises:
        ParameterError: an initial value is of the wrong type or out of range.
        HricError: raised by `on_change` for the initial values.
    """

    def __init__(
        self, namespace: str, parameters: Sequence[LiveParameter], on_change: OnChange, initial: Mapping[str, object]
    ) -> None:
        self._namespace = namespace
        self._parameters = {parameter.name: _declaration(parameter) for parameter in parameters}
        self._on_change = on_change
        self.values: ParameterValues = {p.name: p.default for p in parameters}
        self._apply(initial)

    def change(self, changes: Mapping[str, object]) -> ParameterValues:
        """Apply changes and return all values that are then in force.

        Raises:
            UnknownNameError: there is no live parameter of this name.
            HricError: a value has the wrong type, is out of range, or is refused by the owner; nothing was changed.
        """
        self._apply(changes)
        return dict(self.values)

    def _apply(self, changes: Mapping[str, object]) -> None:
        check_known("live parameter", changes, self._parameters, self._namespace)
        where = self._namespace.rstrip("/")
        checked = {name: self._parameters[name].checked(value, f"{where}/{name}") for name, value in changes.items()}
        requested = self.values | checked
        in_force = self._on_change(dict(requested))
        self.values = {name: in_force.get(name, requested[name]) for name in self._parameters}


def _declaration(live: LiveParameter) -> Parameter:
    """Return the declaration by which values of a live parameter are checked."""
    bounds = {"minimum": live.minimum, "maximum": live.maximum} if live.minimum < live.maximum else {}
    return _KINDS[type(live.default)](**bounds)
