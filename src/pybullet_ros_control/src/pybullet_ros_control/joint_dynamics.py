"""Joint efforts that make the engine's step one of second order, with rotor inertia and friction, which the engine does
not know.

The engine solves  M x = tau' + tau_ext + tau_eng - h(q, v)  and steps by v += dt x, q += dt v (semi-implicit Euler).
Its position belongs to the middle of the coming step, its velocity to the beginning; so the bias h must be that of the
velocity in the middle, and so must what friction takes:
    (M + B) x = tau + tau_ext + tau_eng - h(q, u) - f(u),   u = v + dt/2 x   (implicit midpoint rule, two passes for u)
    tau' = tau - B x - f(u) + h(q, v) - h(q, u)
makes the engine's x this one. B = diag(b): rotor inertia; f: damping and the identified sigmoid, linearised in x in
each pass, so that damping of any size is stable; Coulomb friction is the effort within its bounds that comes nearest to
stopping each joint in this step. Here tau_ext are the efforts of forces that the plant applies itself (known
beforehand), and tau_eng those that the engine adds on its own (rigid contact, joint stops). The latter show only
afterwards, in a velocity that differs from the predicted one:
    tau_eng(k) = tau_eng(k-1) + M (v - v_predicted) / dt.
Joints whose acceleration is prescribed (brakes, drives) leave the equations: the engine's motor supplies what they
need. So a static press is exact, and at a joint stop or a fixed rigid object the impulse converges to that of M + B
within a few steps. Against a free rigid object it does not: the engine parts them after the impulse of the bare links.
Penalty contact is known beforehand and exact in both cases.
"""

import math
from collections.abc import Sequence
from typing import Any, Protocol

from hric_control.geometry import FloatArray
from hric_control.native import load
from hric_control.plants import Losses
from pybullet_ros_control.urdf_model import EngineModel

Vector = Sequence[float]
_built = load("hric_joint_dynamics")
PASSES = 2
"""Evaluations of bias and friction in the middle of a step: a third changes the thesis's raw setpoint (Kp 50, 4 s) by
at most 1.5e-7 rad, and 1e-9 with rotor inertia; one alone leaves 5e-6."""


class Dynamics(Protocol):
    """The compiled dynamics of one robot; remembers one step. Vectors are n floats in the order of the engine's moving
    joints."""

    def torque(
        self, q: Vector, dq: Vector, tau: Vector, external: Vector | None, prescribed: Sequence[float | None] | None, /
    ) -> list[float]:
        """Efforts tau' for the engine in the coming step [N m].

        Args:
            q, dq: the engine's present state [rad, rad/s].
            tau: efforts of the motors [N m].
            external: efforts of the forces that the plant applies in this step [N m]; None for none.
            prescribed: acceleration that a motor of the engine enforces, None for the other joints [rad/s^2].
        """

    def read(
        self, states: Sequence[Sequence[Any]], tau: Vector, /
    ) -> tuple[list[float], list[float], list[float], list[float], bool]:
        """The state that the step has led to, out of what `getJointStates` returns.

        Args:
            tau: efforts of the motors in the step [N m].

        Returns:
            Positions and velocities of the engine, positions at the measuring instant, efforts behind the rotors, and
            whether all is finite and no joint faster than `quiet`.
        """

    def rotor_efforts(self, dq: Vector, /) -> list[float]:
        """B (dq - dq before) / dt: what the rotors took up in the step that ended with dq [N m]."""

    def forget(self) -> None:
        """The state was set from outside: the next step starts without memory."""

    def mass_matrix(self, q: Vector, /) -> list[float]:
        """M of the links at q, n x n floats row-major [kg m^2]."""

    def bias(self, q: Vector, dq: Vector, /) -> list[float]:
        """h(q, dq): Coriolis, centrifugal and gravity efforts [N m]."""


def make_dynamics(
    model: EngineModel,
    joints: Sequence[str],
    losses: Sequence[Losses],
    gravity: Vector,
    time_step: float,
    *,
    second_order: bool,
    half: float = 0.0,
    quiet: float = math.inf,
) -> Dynamics:
    """The dynamics of a robot whose base is where the engine has it.

    Args:
        model: what the engine was given; the description's root link is at the world's origin.
        joints: names of the moving joints in the engine's order, parents before children.
        losses: of these joints.
        gravity: in the world frame, 3 floats [m/s^2].
        time_step: [s].
        second_order: bias and friction at the middle of the step; else at its beginning, as the engine has them.
        half: what the engine's positions are ahead of the measuring instant [s].
        quiet: speed that no joint has before it diverges [rad/s or m/s].
    """
    number = {model.joints[name].child: i for i, name in enumerate(joints)}
    rows = []
    for name, loss in zip(joints, losses, strict=True):
        parent, T_parent_joint = model.placements[name]
        if parent == model.base:
            T_parent_joint = model.T_root_base @ T_parent_joint
        rows.append(
            [
                float(number.get(parent, -1)),
                *_row(model, name, T_parent_joint),
                loss.rotor,
                loss.coulomb,
                loss.damping,
                *loss.sigmoid_row(),
            ]
        )
    dynamics: Dynamics = _built.Dynamics(time_step, PASSES if second_order else 0, half, quiet, list(gravity), rows)
    return dynamics


def _row(model: EngineModel, name: str, T_parent_joint: FloatArray) -> list[float]:
    joint = model.joints[name]
    body = model.bodies[joint.child]
    pose = [*T_parent_joint[:3, :3].ravel().tolist(), *T_parent_joint[:3, 3].tolist()]
    return [
        float(joint.type == "prismatic"),
        *pose,
        *joint.axis,
        body.mass,
        *body.com.tolist(),
        *body.inertia.ravel().tolist(),
    ]
