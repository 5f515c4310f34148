"""Parameters of the generic simulated robot, read and checked."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from hric_control.errors import ParameterError, UnknownNameError
from hric_control.joint_limits import KINDS, JointLimits
from hric_control.limit_loading import DEFAULT_KINDS
from hric_control.node import Node


def mapping(node: Node, name: str) -> dict[str, Any]:
    """A set of parameters, empty by default.

    Raises:
        ParameterError: it is something else.
    """
    value = node.param(name, {})
    if not isinstance(value, Mapping):
        raise ParameterError(f"{node.resolve(name)} must be a set of parameters; got {value!r}")
    return dict(value)


def flag(node: Node, name: str, default: bool) -> bool:
    """A truth value.

    Raises:
        ParameterError: it is something else.
    """
    value = node.param(name, default)
    if not isinstance(value, bool):
        raise ParameterError(f"{node.resolve(name)} must be true or false; got {value!r}")
    return value


def limit_kinds(node: Node) -> tuple[str, ...]:
    """Kinds of limits to enforce, from `enforce_limits`: true (all but acceleration and jerk), false, or a list of kinds.

    Raises:
        ParameterError: an unknown kind.
    """
    value = node.param("enforce_limits", True)
    if isinstance(value, bool):
        return DEFAULT_KINDS if value else ()
    if isinstance(value, (list, tuple)) and all(kind in KINDS for kind in value):
        return tuple(value)
    raise ParameterError(f"{node.resolve('enforce_limits')} must be true, false or a list of {', '.join(KINDS)}; got {value!r}")


def q_start(node: Node, names: Sequence[str], limits: Sequence[JointLimits]) -> list[float]:
    """Start positions from `q_start`: a list in the order of the joints, or a mapping by joint, n floats [rad or m].

    A joint that is not named starts at zero, or at the end of its range next to zero.

    Raises:
        ParameterError: not numbers, or not as many as joints.
        UnknownNameError: a joint that does not exist.
    """
    value, where = node.param("q_start", {}), node.resolve("q_start")
    if isinstance(value, Mapping):
        for name in value:
            if name not in names:
                raise UnknownNameError("joint", name, names, where)
        usual = [min(max(0.0, limit.lower), limit.upper) for limit in limits]
        value = [value.get(name, start) for name, start in zip(names, usual, strict=True)]
    numbers = isinstance(value, (list, tuple)) and all(isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x) for x in value)
    if not numbers or len(value) != len(names):
        raise ParameterError(f"{where} must be {len(names)} finite numbers for {', '.join(names)}, or a mapping by joint; got {value!r}")
    return [float(x) for x in value]
