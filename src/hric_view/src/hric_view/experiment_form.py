"""Form of an experiment: its parameters with text, unit, range and value, from the schema of experiment files.

The values are those of the file and of its controllers, or defaults. Keys without a schema, such as the arguments of
the robot's description, are offered if the file sets them.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from hric_control.sim.simulated_robot import SimulatedRobot
from hric_core import plugins
from hric_core.errors import HricError, check_known
from hric_core.parameters import json_schema
from hric_run.definition import experiment, overrides, parameters
from hric_run.simulation import refuse_wires

NOT_OFFERED = ("robot.hw", "robot.urdf")
"""Keys that no form offers, so that a run that a page starts has the simulated robot of its file."""
PLAIN = re.compile(r"(?:[\w :,;()+-]|\.(?=\d))*|[-+*.\d ]*pi *(?:/ *[.\d]+)?")
"""Texts that a page may send: words and multiples of pi; a path has a slash, or a dot before a letter."""
TYPES: dict[str, Any] = {
    "boolean": bool,
    "integer": int | float,
    "number": int | float,
    "string": str,
    "array": list,
    "object": Mapping,
}
"""Python type of each type in a JSON schema."""


@dataclass(frozen=True)
class FormField:
    """Parameter that a form offers.

    Attributes:
        key: key of its override, a dotted path in the experiment file.
        group, label: heading of its part of the form, and its name below that heading.
        kind: "flag", "choice", "list" (of numbers or words), "number" or "text".
        value: value without an override; None: it is not set.
        text: description.
        unit: unit; "": none, or the schema has none.
        valid: range; "": the schema has none.
        choices: valid words of a choice.
    """

    key: str
    group: str
    label: str
    kind: str
    value: Any
    text: str
    unit: str
    valid: str
    choices: tuple[str, ...] = ()

    @property
    def shown(self) -> str:
        """Value as text for an input: items of a list are separated by commas."""
        items = self.value if isinstance(self.value, list) else [] if self.value is None else [self.value]
        return ", ".join(item if isinstance(item, str) else repr(item) for item in items)


def hindrance(name: str) -> str:
    """Return why an experiment of the workspace cannot run without a ROS master and a real robot; "": it can."""
    try:
        definition = experiment.load(name)
        refuse_wires(definition)
        simulated = issubclass(plugins.find(plugins.ROBOT_HW, definition.robot.hw), SimulatedRobot)
    except HricError as error:
        return str(error)
    return "" if simulated else f"{definition.robot.hw} is not simulated; valid: scripts/bringup experiment:={name}"


def fields(name: str) -> list[FormField]:
    """Return the parameters of an experiment of the workspace.

    Raises:
        HricError: there is no such experiment, or its file has a mistake.
    """
    check_known("experiment", [name], experiment.names())
    definition, schema = experiment.load(name), json_schema(experiment.Experiment)
    controllers = parameters.controllers(definition)
    types: dict[str, Any] = {
        key: plugins.find(plugins.CONTROLLER, str(one["type"])) for key, one in controllers.items()
    }
    own = {
        key: {
            "properties": {
                name: shape for one in kind.settings for name, shape in json_schema(one)["properties"].items()
            }
        }
        for key, kind in types.items()
    }
    schema["properties"]["parameters"] = {"properties": own}
    main = definition.setpoints[0].controller if definition.setpoints else definition.controllers[-1]
    texts = {path.format(controller=main): text for path, text in overrides.SHORTCUTS.values()}
    return list(_fields(schema, {**experiment.read(name), "parameters": controllers}, (), texts))


def words(name: str, values: Mapping[str, Any]) -> list[str]:
    """Return the overrides `KEY:=VALUE` of changed parameters.

    Args:
        name: name of an experiment of the workspace.
        values: new values by key.

    Raises:
        HricError: the form does not offer a key, or a value is not plain; all else is checked by the experiment.
    """
    check_known("parameter", values, [field.key for field in fields(name)])
    for key, value in values.items():
        if not all(
            isinstance(item, bool | int | float | str) and _plain(item)
            for item in (value if isinstance(value, list) else [value])
        ):
            raise HricError(f"{key} is {value!r}; valid here: numbers, words and multiples of pi, but no paths")
    return [f"{key}:={overrides.in_yaml(value)}" for key, value in values.items()]


def _plain(value: Any) -> bool:
    """Return False for a text that a page may not send."""
    return not isinstance(value, str) or PLAIN.fullmatch(value) is not None


def _fields(schema: dict[str, Any], value: Any, path: tuple[str, ...], texts: Mapping[str, str]) -> Iterator[FormField]:
    """Yield the parameters of a part of the file.

    Args:
        schema: schema of the part.
        value: contents of the part; None: it is not there.
        path: keys that lead to the part.
        texts: descriptions by key, for parameters whose schema has none.
    """
    forms = _alternatives(schema)
    form = next((one for one in forms if _fits(one, value)), forms[0])
    if value is None and "properties" in form and len(forms) == 1:
        value = {}  # a section with defaults
    if isinstance(value, Mapping):
        properties, other = form.get("properties", {}), form.get("additionalProperties")
        for name in dict.fromkeys([*properties, *map(str, value)]):
            inner = properties.get(name) or (other if isinstance(other, dict) else {})
            if "." not in name and "/" not in name:  # no override has such a key
                yield from _fields(inner, value.get(name, inner.get("default")), (*path, name), texts)
    elif isinstance(value, list) and any(isinstance(item, list | Mapping) for item in value):
        for index, item in enumerate(value):
            yield from _fields(form.get("items", {}), item, (*path, str(index)), texts)
    elif {"const", "properties"}.isdisjoint(form) and ("enum" in form or _plain(value)):
        key = ".".join(path)
        if key not in NOT_OFFERED:
            yield _field(forms, form, value, key, texts)


def _field(
    forms: list[dict[str, Any]], form: dict[str, Any], value: Any, key: str, texts: Mapping[str, str]
) -> FormField:
    """Return a parameter; forms: forms that a value may have; form: that of the present value."""
    path = key.split(".")
    above = 2 if path[0] == "parameters" else min(len(path) - 1, 1)
    group = path[above - 1] if above else "experiment"
    items = form.get("items", {})
    unit = form.get("unit") or items.get("unit", "")
    text = form.get("description", "").removesuffix(f"[{unit}]").strip() or texts.get(key, "")
    choices = tuple(form.get("enum", ()))
    valid = _range(form) or _range(items)
    return FormField(key, group, ".".join(path[above:]), _kind(forms, form, value), value, text, unit, valid, choices)


def _kind(forms: list[dict[str, Any]], form: dict[str, Any], value: Any) -> str:
    if "enum" in form:
        return "choice"
    if isinstance(value, bool) or form.get("type") == "boolean":
        return "flag"
    if isinstance(value, list) or any("items" in one for one in forms):
        return "list"
    return "number" if isinstance(value, int | float) or form.get("type") in ("number", "integer") else "text"


def _range(form: dict[str, Any]) -> str:
    """Return the range that a schema allows, as text."""
    words = (("exclusiveMinimum", "above"), ("minimum", "from"), ("maximum", "up to"))
    return " ".join(f"{word} {form[key]:g}" for key, word in words if key in form)


def _alternatives(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the forms that a value may have, each with the description and the unit that hold for all."""
    outer = {name: part for name, part in schema.items() if name != "anyOf"}
    if "anyOf" not in schema:
        return [outer]
    return [{**one, **outer} for inner in schema["anyOf"] for one in _alternatives(inner)]


def _fits(form: dict[str, Any], value: Any) -> bool:
    """Return True if a value, or None for no value, has the type of a form and the kind of a variant."""
    if value is None:
        return form.get("type") != "null"
    if "enum" in form:
        return value in form["enum"]
    types, required = form.get("type", []), form.get("required", ())
    types = [types] if isinstance(types, str) else types
    words = {name: one["const"] for name, one in form.get("properties", {}).items() if "const" in one}
    if isinstance(value, Mapping) and any(
        value.get(name, None if name in required else word) != word for name, word in words.items()
    ):
        return False
    return not types or any(isinstance(value, TYPES[name]) for name in types if name in TYPES)
