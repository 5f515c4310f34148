"""Command line of `rosrun panda_description urdf`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hric_control.errors import ParameterError, UnknownNameError
from panda_description.description import Argument, arguments, load

_BOOLS = {"true": True, "1": True, "false": False, "0": False}


def usage() -> str:
    """Help text: each argument with default, valid values and meaning."""
    lines = ["usage: rosrun panda_description urdf [ARG:=VALUE ...]", "Prints the Panda as pure URDF.", ""]
    for name, argument in arguments().items():
        lines.append(f"  {name}:={argument.default}".lower() if isinstance(argument.default, bool) else f"  {name}:={argument.default}")
        lines.append(f"      {argument.description}; {argument.valid}")
    return "\n".join(lines)


def parse(words: Sequence[str]) -> dict[str, Any]:
    """Arguments of `load` from words such as `hand:=false`.

    Raises:
        UnknownNameError: an argument that does not exist; lists those that do.
        ParameterError: a word without := or a value that cannot be read.
    """
    valid = arguments()
    given: dict[str, Any] = {}
    for word in words:
        name, separator, text = word.partition(":=")
        if not separator:
            raise ParameterError(f"{word!r} is not of the form ARG:=VALUE; arguments: {', '.join(valid)}")
        if name not in valid:
            raise UnknownNameError("argument", name, valid)
        given[name] = _value(name, text, valid[name])
    return given


def _value(name: str, text: str, argument: Argument) -> str | bool | float:
    try:
        if isinstance(argument.default, bool):
            return _BOOLS[text.strip().lower()]
        return float(text) if isinstance(argument.default, float) else text
    except (KeyError, ValueError) as error:
        raise ParameterError(f"argument {name} of the Panda's description is {text!r}; valid: {argument.valid}") from error


def run(words: Sequence[str]) -> str:
    """What the command prints."""
    if any(word in ("-h", "--help") for word in words):
        return usage()
    return load(**parse(words))
