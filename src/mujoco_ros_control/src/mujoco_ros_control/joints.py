"""Access to the joints of the robot or a model in MuJoCo's data, and one step of the simulation, by C code.

A step takes and returns Python lists in one call; each numpy view would cost a microsecond more. The identified
friction and mimic joints act within each stage of a (Runge-Kutta) step. MuJoCo's functions are those of the library
that its Python package has loaded.
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
"""Names of MuJoCo functions, in the order that the compiled module expects."""
HELD = 1e13
"""Artificial rotor inertia that fixes a braked or driven joint [kg m^2].

With it a braked Panda with a payload of 3 kg sinks by 7e-10 rad in 20 s.
"""


class Joints(Protocol):
    """Interface of the compiled object for n joints with one coordinate each; vectors are n floats in their order."""

    def read(self) -> tuple[list[float], list[float], list[float]]:
        """Return MuJoCo's positions [rad or m] and velocities, and the positions at the measuring instant."""

    def put(self, q: Vector, dq: Vector, /) -> None:
        """Set positions and velocities, given at the measuring instant [rad or m], [rad/s or m/s]."""

    def write(self, efforts: Vector, /) -> None:
        """Set the motor efforts of the coming step [N m or N]."""

    def write_within(self, efforts: Vector, low: Vector, high: Vector, /) -> bool:
        """Do `write` if all positions are within [low, high]; return whether they are [N m or N, rad or m]."""

    def passed(self, efforts: Vector, /) -> list[float]:
        """Return the efforts on the link side of the rotors since `write` [N m or N]; efforts: those of the motors."""

    def loads(self) -> list[tuple[Triple, Triple, Triple]]:
        """Return the load that the parent link exerts on the child link through each joint, in the world frame.

        At the start (semi-implicit integrator) or the end of the last step: origin of the child [m], force [N], torque
        about that origin [N m].
        """

    def prepare(self) -> None:
        """Begin a step of the complete scene: update positions and velocities of all bodies; forces can then be set."""

    def accelerate(self) -> None:
        """Compute the accelerations from all forces, after `prepare`."""

    def integrate(self) -> None:
        """Complete the step, after `accelerate`."""

    def finish(
        self, efforts: Vector, prepared: bool, /
    ) -> tuple[list[float], list[float], list[float], list[float], bool]:
        """Make a step with these motor efforts [N m or N], or complete the prepared one, and return the new state.

        Returns:
            MuJoCo's positions and velocities, positions at the measuring instant, efforts on the link side of the
            rotors, and True if all are finite and no joint is faster than `quiet`.
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
    """Return the compiled object for some joints of a compiled scene.

    Args:
        m: MuJoCo's model; the result keeps a reference to it.
        d: MuJoCo's data; the result keeps a reference to it.
        dofs: index of each joint in MuJoCo's velocities (qvel).
        positions: index of each joint in MuJoCo's positions (qpos).
        losses: rotor inertia and friction of each joint; damping and sigmoid friction are already in the model.
        half: time by which the engine's positions are ahead of its velocities [s].
        quiet: speed that no joint reaches unless the simulation diverges [rad/s or m/s].
    """
    functions = tuple(ctypes.cast(_library()[name], ctypes.c_void_p).value for name in _FUNCTIONS)
    rotors, bristles = [loss.rotor for loss in losses], [value for loss in losses for value in loss.bristle_row()]
    made: Joints = _built.Joints(
        m._address, d._address, functions, dofs, positions, rotors, bristles, half, quiet, HELD, (m, d)
    )
    return made


def install_friction() -> None:
    """Register the compiled joint friction as MuJoCo's passive-force callback for all models of this process.

    Models without friction parameters are not affected.
    """
    ctypes.c_void_p.in_dll(_library(), "mjcb_passive").value = _built.friction_address()


def install_laws() -> None:
    """Register the compiled mimic laws as MuJoCo's control callback for all models of this process.

    Models without mimic joints are not affected.
    """
    ctypes.c_void_p.in_dll(_library(), "mjcb_control").value = _built.laws_address()
