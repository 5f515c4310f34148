"""YAML files with joint friction parameters: a fit writes them; models, plants and fits read them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from hric_control.plants import BREAKAWAY, PHI, Phi, breakaways, sigmoid_parameters
from hric_core.errors import ParameterError
from hric_core.parameters import read_yaml

if TYPE_CHECKING:
    from franka_hw_interface.friction_fit import (
        JointFriction,  # scipy takes half a second, which is avoided without a fit
    )

JOINTS = tuple(f"joint{i}" for i in range(1, 8))
_NAME = re.compile(r"(?:.*_)?(joint[1-7])")
_LAW = """\
# tau_f = phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3)), zero at rest. phi1 [N m], phi2 [s/rad], phi3 [rad/s].
# breakaway [N m]: torque that friction withstands while the joint is at rest.
"""  # noqa: E501


def read_friction(path: Path) -> list[Phi]:
    """Read a friction file; return (phi1 [N m], phi2 [s/rad], phi3 [rad/s]) of joints 1 to 7. Raises ParameterError."""
    return sigmoid_parameters(read_parameters(path), JOINTS)


def read_parameters(path: Path) -> dict[str, list[float]]:
    """Read a friction file; return phi1 [N m], phi2 [s/rad], phi3 [rad/s] and, if present, breakaway [N m].

    Each is a list of 7 values.

    The joint names may have the prefix of any arm (`panda_joint1`) or none; the form {phi1: [7 values], phi2: [...],
    phi3: [...]} is accepted, too.

    Raises:
        ParameterError: the file cannot be read, or does not have these values of seven joints.
    """
    content = read_yaml(path)
    if not isinstance(content, dict):
        raise ParameterError(f"the friction file {path} must map joints to phi1, phi2 and phi3")
    named = {str(match[1] if (match := _NAME.fullmatch(str(key))) else key): value for key, value in content.items()}
    unknown = sorted(set(named) - {*JOINTS, *PHI, BREAKAWAY})
    if unknown or len(named) != len(content):
        raise ParameterError(
            f"the friction file {path} has {', '.join(unknown) or 'a joint twice'}; valid: {', '.join(JOINTS)}, "
            "each once, with any prefix"
        )
    try:
        phis, held = sigmoid_parameters(named, JOINTS), breakaways(named, JOINTS)
    except ParameterError as error:
        missing = [joint for joint in JOINTS if joint not in named and not set(PHI) <= set(named)]
        hint = f"; missing: {', '.join(missing)}" if missing else f" ({BREAKAWAY}, if present, must not be negative)"
        raise ParameterError(
            f"the friction file {path} must give finite numbers phi1, phi2 and phi3 of joint1 to joint7{hint}"
        ) from error
    lists = {name: list(values) for name, values in zip(PHI, zip(*phis, strict=True), strict=True)}
    has_breakaway = BREAKAWAY in named or any(BREAKAWAY in named.get(joint, ()) for joint in JOINTS)
    return {**lists, BREAKAWAY: held} if has_breakaway else lists


def friction_text(fits: Sequence[JointFriction], about: Iterable[str]) -> str:
    """Return the text of a friction file: one joint per line, with a summary of its fit as a comment.

    Args:
        fits: fitted friction of each joint.
        about: lines for the header comment.
    """
    rows = []
    for fit in fits:
        named = zip((*PHI, BREAKAWAY), (*fit.phi, fit.breakaway), strict=True)
        values = ", ".join(f"{name}: {value:.6f}" for name, value in named)
        rows.append(f"{fit.joint}: {{{values}}}  # {fit.summary()}\n")
    return "".join([*(f"# {line}\n" for line in about), _LAW, *rows])
