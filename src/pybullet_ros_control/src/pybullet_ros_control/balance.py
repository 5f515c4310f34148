"""The balance of joint efforts with rotor inertia: compiled, and the same sums in Python where there is no compiler."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Sequence
from pathlib import Path

from hric_control.errors import HricError
from hric_control.extension import load_extension

Matrix = Sequence[Sequence[float]]
Vector = Sequence[float]
Balance = Callable[[Matrix, Vector, Vector, Vector, Vector, float], tuple[list[float], list[float]]]

SOURCE = Path(__file__).with_name("balance.c")
MOST_COMPILED = 64
"""Joints that the compiled function takes."""
LOG = logging.getLogger("hric.pybullet_ros_control")


def make_balance(n: int) -> Balance:
    """A function (M, h, t, b, v, dt) -> (t - b x, v + dt x) with x solving (M + diag(b)) x = t - h, on plain floats, for n x n matrices.

    By the square-root-free Cholesky method; only the lower triangle of the symmetric positive definite M is read.
    """
    return (compiled() if n <= MOST_COMPILED else None) or written_out(n)


@functools.cache
def compiled() -> Balance | None:
    """The compiled function, for any n up to MOST_COMPILED; None where it cannot be compiled, which is said."""
    try:
        balance: Balance = load_extension(SOURCE.read_text(), "hric_balance").balance
    except HricError as error:
        LOG.info("rotor inertia is balanced without compiled code, which takes longer: %s", error)
        return None
    return balance


def _balance_lines(n: int) -> list[str]:
    """(M + B) = L D L' with d_i = 1 / D_i and c_ij = l_ij D_j, then L y = t - h and D L' x = y."""
    lines = []
    for i in range(n):
        for j in range(i):
            lines.append(f"c{i}_{j} = m{i}_{j}" + "".join(f" - c{i}_{k} * l{j}_{k}" for k in range(j)))
        lines += [f"l{i}_{j} = c{i}_{j} * d{j}" for j in range(i)]
        lines.append(f"d{i} = 1.0 / (m{i}_{i} + b{i}" + "".join(f" - c{i}_{k} * l{i}_{k}" for k in range(i)) + ")")
    for i in range(n):
        lines.append(f"y{i} = t{i} - h{i}" + "".join(f" - l{i}_{k} * y{k}" for k in range(i)))
    for i in reversed(range(n)):
        lines.append(f"x{i} = y{i} * d{i}" + "".join(f" - l{k}_{i} * x{k}" for k in range(i + 1, n)))
    return lines


def written_out(n: int) -> Balance:
    """The balance in Python, written out line by line for this n: for seven joints 7 us, where numpy and LAPACK need over 20 us, most of it for
    turning tuples into arrays and back.
    """

    def row(letter: str) -> str:
        return "(" + "".join(f"{letter}{i}, " for i in range(n)) + ")"

    matrix = "(" + "".join("(" + "".join(f"m{i}_{j}, " if j <= i else "_, " for j in range(n)) + "), " for i in range(n)) + ")"
    torque = "[" + ", ".join(f"t{i} - b{i} * x{i}" for i in range(n)) + "]"
    velocity = "[" + ", ".join(f"v{i} + dt * x{i}" for i in range(n)) + "]"
    lines = [f"{matrix} = M", *(f"{row(x)} = {x}" for x in "htbv"), *_balance_lines(n), f"return {torque}, {velocity}"]
    scope: dict[str, Balance] = {}
    exec("def balance(M, h, t, b, v, dt):\n    " + "\n    ".join(lines), {}, scope)
    return scope["balance"]
