"""Conversion of dataclasses to JSON values and back, and their JSON schema, by the types of the fields.

A field whose default is None is left out of the JSON if its value is None. A field without a default is always written.
"""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from hric_core.errors import HricError

T = TypeVar("T")
JsonSchema = dict[str, Any]
"""JSON schema as a dict."""
NAMES = {bool: "boolean", int: "integer", float: "number", str: "string", NoneType: "null"}
"""Name of each plain Python type in a JSON schema."""


class JsonValueError(HricError):
    """JSON value that does not match the type of a dataclass field; the message names field and type."""


def to_json(value: object) -> Any:
    """Return dataclasses, mappings and sequences as the values that `json.dumps` writes."""
    if is_dataclass(value):
        parts = ((item.name, item.default, getattr(value, item.name)) for item in fields(value))
        return {name: to_json(part) for name, default, part in parts if part is not None or default is not None}
    if isinstance(value, Mapping):
        return {key: to_json(part) for key, part in value.items()}
    return [to_json(part) for part in value] if isinstance(value, list | tuple) else value


@cache
def _types(kind: type) -> dict[str, type]:
    """Return the type of each field of a dataclass by its name."""
    hints = get_type_hints(kind)
    return {item.name: hints[item.name] for item in fields(kind)}


def _optional(kind: Any) -> tuple[Any, bool]:
    """Return a type without None, and True if None is valid."""
    members = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    return next(member for member in members if member is not NoneType), NoneType in members


def from_json(kind: type[T], data: object, where: str = "") -> T:
    """Return a dataclass from its JSON values; unknown keys are ignored, a missing key counts as null.

    Args:
        kind: dataclass.
        data: JSON values.
        where: name of the data in errors.

    Raises:
        JsonValueError: a value does not have the type of its field.
    """
    result: T = _value(kind, data, where)
    return result


def _value(kind: Any, data: Any, where: str) -> Any:
    inner, optional = _optional(kind)
    if data is None and optional:
        return None
    container, parts = get_origin(inner), get_args(inner)
    if is_dataclass(inner) and isinstance(data, Mapping):
        types = _types(inner)  # type: ignore[arg-type]
        return inner(**{name: _value(part, data.get(name), f"{where}.{name}") for name, part in types.items()})  # type: ignore[operator]
    if container in (list, tuple) and isinstance(data, list | tuple):
        return container(_value(parts[0], item, f"{where}[{k}]") for k, item in enumerate(data))
    if container is dict and isinstance(data, Mapping):
        return {key: _value(parts[1], item, f"{where}.{key}") for key, item in data.items()}
    if inner in NAMES and isinstance(data, int | float if inner is float else inner):
        return data
    raise JsonValueError(f"{where.lstrip('.')} is {json.dumps(data)[:40]}; valid: {getattr(inner, '__name__', inner)}")


def schema(kind: Any) -> JsonSchema:
    """Return the JSON schema of a dataclass, or of the type of one of its fields."""
    inner, optional = _optional(kind)
    container, parts = get_origin(inner), get_args(inner)
    made: JsonSchema
    if is_dataclass(inner):
        required = [item.name for item in fields(inner) if item.default is not None]
        properties = {name: schema(part) for name, part in _types(inner).items()}  # type: ignore[arg-type]
        made = {"type": "object", "properties": properties, "required": required, "additionalProperties": False}
    elif container is dict:
        made = {"type": "object", "additionalProperties": schema(parts[1])}
    else:
        made = {"type": NAMES[inner]} if inner in NAMES else {"type": "array", "items": schema(parts[0])}
    return {"anyOf": [made, {"type": "null"}]} if optional else made
