"""Fields of the web form that starts a run: the parameters of an experiment with text, unit, range and value.

Text, unit and range come from the schema of experiment files; values are those of the file and of its controllers, or
defaults. Keys without a schema, such as the xacro arguments of the robot's description, are offered if the file sets
them.
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
"""Keys that the form does not offer, so that a page cannot start a run with another robot than that of the file."""
PLAIN = re.compile(r"(?:[\w :,;()+-]|\.(?=\d))*|[-+*.\d ]*pi *(?:/ *[.\d]+)?")
"""Pattern of texts that a page may send: words and multiples of pi, but no paths (slash, or dot before a letter)."""
TYPES: dict[str, Any] = {
    "boolean": bool,
    "integer": int | float,
    "number": int | float,
    "string": str,
    "array": list,
    "object": Mapping,
}
"""Python type by the name of the type in a JSON schema."""


@dataclass(frozen=True)
class FormField:
    """Parameter that the form offers.

    Attributes:
        key: dotted path of the parameter in the experiment file, as in an override `KEY:=VALUE`.
        group: heading of the part of the form with this parameter.
        label: name of the parameter below this heading.
        kind: kind of input: "flag", "choice", "list" (of numbers or words), "number" or "text".
        value: value without an override; None: the experiment does not set it.
        text: description of the parameter.
        unit: unit of the value; "": the schema has none.
        valid: range of the value as text; "": the schema has none.
        choices: valid words, for the kind "choice".
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
        """Value as text for the input field; items of a list are separated by commas."""
        items = self.value if isinstance(self.value, list) else [] if self.value is None else [self.value]
        return ", ".join(item if isinstance(item, str) else repr(item) for item in items)


def hindrance(name: str) -> str:
    """Return the reason why an experiment of the workspace cannot be a headless simulation; "": it can."""
    try:
        definition = experiment.load(name)
        refuse_wires(definition)
        simulated = issubclass(plugins.find(plugins.ROBOT_HW, definition.robot.hw), SimulatedRobot)
    except HricError as error:
        return str(error)
    return "" if simulated else f"{definition.robot.hw} is not simulated; run:  scripts/bringup experiment:={name}"


def fields(name: str) -> list[FormField]:
    """Return the parameters that the form of an experiment of the workspace offers.

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
    """Return the overrides `KEY:=VALUE` for the parameters that a viewer has changed.

    Ranges are checked later, when the experiment is loaded with the overrides.

    Args:
        name: name of an experiment of the workspace.
        values: new values by `FormField.key`.

    Raises:
        HricError: the form does not offer a key, or a value is a path or a mapping.
    """
    check_known("parameter", values, [field.key for field in fields(name)])
    for key, value in values.items():
        if not all(
            isinstance(item, bool | int | float | str) and _plain(item)
            for item in (value if isinstance(value, list) else [value])
        ):
            raise HricError(f"{key} is {value!r}; valid in this form: numbers, words and multiples of pi, but no paths")
    return [f"{key}:={overrides.in_yaml(value)}" for key, value in values.items()]


def _plain(value: Any) -> bool:
    """Return True for a value that a page may send: a number, or a text that matches PLAIN."""
    return not isinstance(value, str) or PLAIN.fullmatch(value) is not None


def _fields(schema: dict[str, Any], value: Any, path: tuple[str, ...], texts: Mapping[str, str]) -> Iterator[FormField]:
    """Yield the parameters below one key of the experiment file.

    Args:
        schema: JSON schema of the values below this key.
        value: values below this key; None: the file does not have the key.
        path: keys that lead to this one; empty: the complete file.
        texts: descriptions by dotted key, for parameters whose schema has none.
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
    """Return one parameter of the form.

    Args:
        forms: JSON schemas of the alternatives that a value may have.
        form: the alternative that the present value has.
        value: present value; None: it is not set.
        key: dotted path of the parameter.
        texts: descriptions by dotted key, for parameters whose schema has none.
    """
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
    """Return the range of values that a schema allows as text; "": it has none."""
    words = (("exclusiveMinimum", "above"), ("minimum", "from"), ("maximum", "up to"))
    return " ".join(f"{word} {form[key]:g}" for key, word in words if key in form)


def _alternatives(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the alternatives of a schema (anyOf), each with the description and the unit that all have in common."""
    outer = {name: part for name, part in schema.items() if name != "anyOf"}
    if "anyOf" not in schema:
        return [outer]
    return [{**one, **outer} for inner in schema["anyOf"] for one in _alternatives(inner)]


def _fits(form: dict[str, Any], value: Any) -> bool:
    """Return True if a value, or None for "not set", has the type and the `kind` that a schema demands."""
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
