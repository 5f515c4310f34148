"""Joints of the robot or a model in MuJoCo's data, in C, with forces inside a step's stages.

Python lists go in and out of a step in one call, which is a microsecond faster than numpy views for each. The
identified friction and mimic joints act inside the stages of a step. MuJoCo's functions are taken from the library that
its Python package has loaded.
"""

import ctypes
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import mujoco

from hric_control.plants import Losses
from hric_core.native import load

Vector = Sequence[float]
Triple = tuple[float, float, float]
_built = load("hric_mujoco")
_FUNCTIONS = (
    "mj_fwdPosition",
    "mj_fwdVelocity",
    "mj_fwdActuation",
    "mj_fwdAcceleration",
    "mj_fwdConstraint",
    "mj_implicit",
    "mj_RungeKutta",
    "mj_rnePostConstraint",
    "mj_fullM",
    "mj_integratePos",
)
"""MuJoCo functions, in the compiled module's order."""
HELD = 1e13
"""Rotor inertia that fixes a braked or driven joint [kg m^2]: with 3 kg a braked Panda sinks 7e-10 rad in 20 s."""


class Joints(Protocol):
    """Group of joints with one coordinate each; vectors are n floats in their order."""

    def read(self) -> tuple[list[float], list[float], list[float]]:
        """Return present positions and speeds, and positions at the measuring instant [rad or m, rad/s or m/s]."""

    def put(self, q: Vector, dq: Vector, /) -> None:
        """Put the joints at q, dq at the measuring instant [rad or m, rad/s or m/s]."""

    def write(self, efforts: Vector, /) -> None:
        """Set the efforts of the coming step [N m or N]."""

    def passed(self, efforts: Vector, /) -> list[float]:
        """Return the motor efforts behind the rotors since `write` [N m or N]."""

    def loads(self) -> list[tuple[Triple, Triple, Triple]]:
        """Return the loads that parents exert on children through each joint in the last step, world frame.

        At the step's start (semi-implicit) or end: origin of the child [m], force [N], torque there [N m].
        """

    def prepare(self) -> None:
        """Begin a step of the complete scene: update all positions and velocities, so that forces can be set."""

    def accelerate(self) -> None:
        """Compute the accelerations from all forces, in the prepared stage."""

    def integrate(self) -> None:
        """Complete the step."""

    def finish(self, efforts: Vector, /) -> tuple[list[float], list[float], list[float], list[float], bool]:
        """Do the prepared step with these efforts, and return the new state.

        As `read`, then efforts behind the rotors, and True if all are finite and no joint is faster than the bound.
        """


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(Path(mujoco.__file__).parent / f"libmujoco.so.{mujoco.__version__}"))
    ctypes.c_void_p.in_dll(library, "mjcb_time").value = None  # unused statistics, a seventh of a step
    return library


def make_joints(
    m: Any,
    d: Any,
    dofs: Sequence[int],
    positions: Sequence[int],
    losses: Sequence[Losses],
    half: float,
    quiet: float = 0.0,
) -> Joints:
    """Return the joints of a compiled scene.

    Args:
        m: MuJoCo's model, which must live as long as the result.
        d: MuJoCo's data, which must live as long as the result.
        dofs: index of each joint among the speeds.
        positions: index of each joint among the positions.
        losses: losses of each joint; its damping and sigmoid are in the model.
        half: lead of the engine's positions over its speeds [s].
        quiet: speed that no joint reaches before it diverges [rad/s or m/s].
    """
    functions = tuple(ctypes.cast(_library()[name], ctypes.c_void_p).value for name in _FUNCTIONS)
    rotors, bristles = [loss.rotor for loss in losses], [value for loss in losses for value in loss.bristle_row()]
    made: Joints = _built.Joints(
        m._address, d._address, functions, dofs, positions, rotors, bristles, half, quiet, HELD, (m, d)
    )
    return made


def install_friction() -> None:
    """Let MuJoCo call the compiled friction in all models of this process; models without friction are unchanged."""
    ctypes.c_void_p.in_dll(_library(), "mjcb_passive").value = _built.friction_address()


def install_laws() -> None:
    """Let MuJoCo keep mimic joints on their laws in all models of this process; others are unchanged."""
    ctypes.c_void_p.in_dll(_library(), "mjcb_control").value = _built.laws_address()
