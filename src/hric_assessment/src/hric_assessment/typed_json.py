"""Conversion of typed results (dataclasses) to JSON, and of their types to a JSON schema.

    plain(verdict)          # dataclasses, tuples and enums become objects, arrays and strings
    schema_of(Finding)      # all fields are required; extras of `Annotated` are a description or (key, value)

A field whose metadata has the key NAMES is a mapping whose entries replace the field in the object; the metadata's
value is a function that returns the keys that the mapping always has.
"""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import StrEnum
from types import NoneType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

Content = Mapping[str, Any]
"""Content of a YAML or JSON file, or a section of it."""
JsonObject = dict[str, Any]
NAMES = "names"
BASIC = {str: "string", float: "number", int: "integer", bool: "boolean"}
"""Name of the JSON type for each Python type."""


def plain(value: object) -> Any:
    """Convert a value to what JSON can represent; numbers that are not finite become None."""
    if is_dataclass(value):
        parts = {field: plain(getattr(value, field.name)) for field in fields(value)}
        return {
            name: content
            for field, part in parts.items()
            for name, content in (part if NAMES in field.metadata else {field.name: part}).items()
        }
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def schema_of(kind: Any) -> JsonObject:
    """Return the JSON schema of a type: a dataclass, an enum, an optional, a sequence, a mapping, or one of BASIC."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _described(schema_of(parts[0]), *parts[1:])
    if kind in BASIC:
        return {"type": BASIC[kind]}
    if NoneType in parts:
        known = schema_of(parts[0])
        return {"type": [known["type"], "null"]} if [*known] == ["type"] else {"oneOf": [{"type": "null"}, known]}
    if origin is None:
        return {"enum": [*map(str, kind)]} if issubclass(kind, StrEnum) else _of_dataclass(kind)
    if origin is Mapping:
        return {"type": "object", "additionalProperties": schema_of(parts[1])}
    if origin is tuple and ... not in parts:
        items = [schema_of(part) for part in parts]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    return {"type": "array", "items": schema_of(parts[0])}


def closed(properties: Content) -> JsonObject:
    """Return the schema of an object that must have all of these properties, and no others."""
    return {"type": "object", "properties": properties, "required": [*properties], "additionalProperties": False}


def _of_dataclass(kind: Any) -> JsonObject:
    types, properties = get_type_hints(kind, include_extras=True), JsonObject()
    for field in fields(kind):
        part = schema_of(types[field.name])
        named = {name: part["additionalProperties"] for name in field.metadata.get(NAMES, list)()}
        properties |= named if NAMES in field.metadata else {field.name: part}
    return closed(properties)


def _described(schema: JsonObject, *extras: str | tuple[str, Any]) -> JsonObject:
    """Add a description (after the first key) and further keys to a schema; an enum or constant replaces the type."""
    for extra in extras:
        if isinstance(extra, str):
            (key, first), *others = schema.items()
            schema = {key: first, "description": extra, **dict(others)}
        else:
            name, value = extra
            schema = {} if name in ("enum", "const") else schema
            schema = schema | {name: list(value) if isinstance(value, tuple) else value}
    return schema
