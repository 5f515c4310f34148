"""Joints of the robot or a model in MuJoCo's data, in C: lists of Python go in and out of a step in one call, which
takes a microsecond less than views of numpy for each of them; and what acts within the stages of a step: the identified
friction, and joints that mimic others.

MuJoCo's functions are found in the library that its Python package has loaded.
"""

import ctypes
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Protocol

import mujoco

from hric_control.native import load
from hric_control.plants import Losses

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
"""Of MuJoCo, in the compiled module's order."""
HELD = 1e13
"""Rotor inertia of a joint that a brake or a drive holds: nothing else moves it [kg m^2]. Under 3 kg a braked Panda
sinks by 7e-10 rad in 20 s."""


class Joints(Protocol):
    """Some joints with one coordinate each; vectors are n floats in their order."""

    def read(self) -> tuple[list[float], list[float], list[float]]:
        """Positions and speeds of now, and positions at the measuring instant [rad or m, rad/s or m/s]."""

    def put(self, q: Vector, dq: Vector, /) -> None:
        """Be there at the measuring instant [rad or m, rad/s or m/s]."""

    def write(self, efforts: Vector, /) -> None:
        """Efforts that act in the coming step [N m or N]."""

    def passed(self, efforts: Vector, /) -> list[float]:
        """What of the motors' efforts passed the rotors since `write` [N m or N]."""

    def loads(self) -> list[tuple[Triple, Triple, Triple]]:
        """What parents do to children through each joint in the last step, as it began (semi-implicit) or ended: origin
        of the child [m], force [N], torque there [N m], in the world frame."""

    def prepare(self) -> None:
        """Begin a step of the whole scene: positions and velocities of all bodies are those of now, and forces may be
        set that follow from them."""

    def accelerate(self) -> None:
        """Compute what follows from all forces, in the stage that was prepared."""

    def integrate(self) -> None:
        """Do the rest of the step."""

    def finish(self, efforts: Vector, /) -> tuple[list[float], list[float], list[float], list[float], bool]:
        """The step that was prepared, with these efforts; as `read`, then efforts behind the rotors, and whether all is
        finite and no joint faster than the bound."""


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(Path(mujoco.__file__).parent / f"libmujoco.so.{mujoco.__version__}"))
    ctypes.c_void_p.in_dll(library, "mjcb_time").value = None  # statistics that nobody reads, a seventh of a step
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
    """Joints of a compiled scene.

    Args:
        m, d: MuJoCo's model and data, which live as long as the result.
        dofs, positions: of each joint among the speeds and positions.
        losses: of each joint; its damping and sigmoid are in the model.
        half: what the engine's positions are ahead of its speeds [s].
        quiet: speed that no joint has before it diverges [rad/s or m/s].
    """
    functions = tuple(ctypes.cast(_library()[name], ctypes.c_void_p).value for name in _FUNCTIONS)
    rotors, bristles = [loss.rotor for loss in losses], [value for loss in losses for value in loss.bristle_row()]
    made: Joints = _built.Joints(
        m._address, d._address, functions, dofs, positions, rotors, bristles, half, quiet, HELD, (m, d)
    )
    return made


def install_friction() -> None:
    """Let MuJoCo call the compiled friction in all models of this process; those without it do not notice."""
    ctypes.c_void_p.in_dll(_library(), "mjcb_passive").value = _built.friction_address()


def install_laws() -> None:
    """Let MuJoCo keep joints that mimic others on their laws in all models of this process; those without them do not
    notice."""
    ctypes.c_void_p.in_dll(_library(), "mjcb_control").value = _built.laws_address()
