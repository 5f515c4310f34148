"""Joint efforts that make the engine's step second-order accurate, with the rotor inertia and friction that it lacks.

The engine solves  M x = tau' + tau_ext + tau_eng - h(q, v)  and steps by v += dt x, q += dt v (semi-implicit Euler).
Its position belongs to the middle of the coming step, its velocity to the start; so the bias h, and the friction, must
be those of the velocity in the middle:
    (M + B) x = tau + tau_ext + tau_eng - h(q, u) - f(u),   u = v + dt/2 x   (implicit midpoint rule, two passes for u)
    tau' = tau - B x - f(u) + h(q, v) - h(q, u)
makes the engine's x this one. B = diag(b): rotor inertia; f: damping and the identified sigmoid, linearised in x in
each pass, so that damping of any size is stable; Coulomb friction is the effort within its bounds that comes nearest to
stopping each joint in this step. Here tau_ext are the efforts of forces that the plant applies itself (known
beforehand), and tau_eng those that the engine adds (rigid contact, joint stops). The latter are known only afterwards,
from a velocity that differs from the predicted one:
    tau_eng(k) = tau_eng(k-1) + M (v - v_predicted) / dt.
Joints whose acceleration is prescribed (brakes, drives) leave the equations: the engine's motor supplies their effort.
Mimic joints, x = J z, leave them as well: J'(M + B) J z = J'(...), and tau' has the efforts that keep their x on the
law; an engine gear distributes the effects of the engine's contact and stops to both joints.
So a static press is exact, and at a joint stop or a fixed rigid object the impulse converges to that of M + B
within a few steps. Against a free rigid object it does not: the engine separates them after the impulse of the bare
links. Penalty contact is known beforehand and exact in both cases.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np

from hric_control.plants import Losses, PlantConfig
from hric_core.geometry import FloatArray, MassProperties
from hric_core.native import load
from hric_core.urdf import mimic_laws
from hric_dynamics.tree import link_row, pose_row
from pybullet_ros_control.urdf_model import EngineModel

Vector = Sequence[float]
_built = load("hric_joint_dynamics")
PASSES = 2
"""Number of evaluations of bias and friction in the middle of a step.

A third one changes the thesis's raw setpoint (Kp 50, 4 s) by at most 1.5e-7 rad, and 1e-9 with rotor inertia; a single
one leaves 5e-6.
"""

Triple = tuple[float, float, float]
LinkMotion = tuple[Triple, tuple[float, float, float, float], Triple, Triple]
"""Position [m], quaternion (x, y, z, w), linear [m/s] and angular velocity [rad/s] of a frame, in the world."""


class CompiledDynamics(Protocol):
    """Compiled dynamics of one robot with memory of one step; vectors are n floats in the engine's joint order."""

    def torque(
        self, q: Vector, dq: Vector, tau: Vector, external: Vector | None, prescribed: Sequence[float | None] | None, /
    ) -> list[float]:
        """Return the efforts tau' for the engine in the coming step [N m].

        Args:
            q: the engine's present position [rad].
            dq: the engine's present velocity [rad/s].
            tau: efforts of the motors [N m].
            external: efforts of the forces that the plant applies in this step [N m]; None for none.
            prescribed: acceleration that a motor of the engine enforces, None for the other joints [rad/s^2]. Their
                efforts are those of their mimic joints.
        """

    def read(
        self, states: Sequence[Sequence[Any]], tau: Vector, /
    ) -> tuple[list[float], list[float], list[float], list[float], bool]:
        """Return the state after the step, from the result of `getJointStates`.

        Args:
            states: result of `getJointStates`.
            tau: efforts of the motors in the step [N m].

        Returns:
            Positions and velocities of the engine, positions at the measuring instant, efforts behind the rotors, and
            True
            if all are finite and no joint is faster than `quiet`.
        """

    def rotor_efforts(self, dq: Vector, /) -> list[float]:
        """Return B (dq - dq before) / dt, the efforts of the rotors in the step that ended with dq [N m]."""

    def forget(self) -> None:
        """Forget the previous step, after the state was set from outside."""

    def mass_matrix(self, q: Vector, /) -> list[float]:
        """Return M of the links at q, n x n floats row-major [kg m^2]."""

    def mobility(self, q: Vector, /) -> list[float]:
        """Return M^-1 of the links at q, mimic joints included, n x n floats row-major [1/(kg m^2)]."""

    def bias(self, q: Vector, dq: Vector, /) -> list[float]:
        """Return h(q, dq): Coriolis, centrifugal and gravity efforts [N m]."""

    def motion(self, q: Vector, dq: Vector, joint: int, frame: Vector, /) -> LinkMotion:
        """Return the motion of a frame on a link.

        Args:
            q: joint positions [rad].
            dq: joint velocities [rad/s].
            joint: last joint that moves the link; -1: none.
            frame: pose in that joint's link, or in the world if no joint moves it: rotation row-major and position, 12
                floats.
        """

    def efforts(self, q: Vector, joint: int, force: Vector, torque: Vector, point: Vector, /) -> list[float]:
        """Return J' (force, torque), the joint efforts for a point of the link that `joint` moves last [N m or N].

        Args:
            q: joint positions [rad].
            joint: last joint that moves the link.
            force: world frame, 3 floats [N].
            torque: world frame, 3 floats [N m].
            point: point of application, world frame [m].
        """


def half_step(config: PlantConfig) -> float:
    """Return the lead of the engine's positions over the measuring instant [s]."""
    return 0.5 * config.time_step if config.half_step_readout else 0.0


def added(a: Vector | None, b: Vector) -> Vector:
    """Return a + b; a None counts as zero."""
    return b if a is None else [x + y for x, y in zip(a, b, strict=True)]


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
    T_world_base: FloatArray | None = None,
    free: bool = False,
) -> CompiledDynamics:
    """Return the dynamics of a robot.

    Args:
        model: model of the engine.
        joints: names of the moving joints in the engine's order, parents before children.
        losses: losses of these joints.
        gravity: gravity in the world frame, 3 floats [m/s^2].
        time_step: [s].
        second_order: True: bias and friction at the middle of the step; False: at its start, as in the engine.
        half: lead of the engine's positions over the measuring instant [s].
        quiet: speed that no joint reaches before it diverges [rad/s or m/s].
        T_world_base: pose of the engine's base link, shape (4, 4); None: the description's root link is at the world's
            origin.
        free: True if the base moves: six joints along and about its axes at zero are then the first.
    """
    base = model.T_root_base if T_world_base is None else T_world_base
    rows = _free_rows(model.bodies[model.base]) if free else []
    number = {model.base: len(rows) - 1}
    number |= {model.joints[name].child: len(rows) + i for i, name in enumerate(joints)}
    laws = mimic_laws(model.joints)
    for name, loss in zip(joints, losses, strict=True):
        parent, T_parent_joint = model.placements[name]
        if parent == model.base and not free:
            T_parent_joint = base @ T_parent_joint
        joint, law = model.joints[name], laws.get(name)
        follows = (-1.0, 0.0) if law is None else (float(number[model.joints[law.joint].child]), law.multiplier)
        slides = joint.type == "prismatic"
        rows.append(_row(number[parent], slides, T_parent_joint, joint.axis, model.bodies[joint.child], loss, follows))
    dynamics: CompiledDynamics = _built.Dynamics(
        time_step, PASSES if second_order else 0, half, quiet, list(gravity), rows
    )
    return dynamics


def _row(
    parent: int,
    slides: bool,
    T_parent_joint: FloatArray,
    axis: Iterable[float],
    body: MassProperties,
    loss: Losses,
    follows: tuple[float, float] = (-1.0, 0.0),
) -> list[float]:
    link = link_row(parent, slides, T_parent_joint, axis, body)
    return [*link, loss.rotor, loss.coulomb, loss.damping, *loss.sigmoid_row(), *loss.bristle_row(), *follows]


def _free_rows(base: MassProperties) -> list[list[float]]:
    nothing = MassProperties()
    return [
        _row(k - 1, k < 3, np.eye(4), np.eye(3)[k % 3].tolist(), base if k == 5 else nothing, Losses())
        for k in range(6)
    ]


def frame_of(model: EngineModel, joints: Sequence[str], T_world_base: FloatArray, link: str) -> tuple[int, list[float]]:
    """Return (joint, frame) of a link of the description, for `CompiledDynamics.motion`.

    Args:
        model: model of the engine.
        joints: joint names as for `make_dynamics`.
        T_world_base: pose of the engine's base link, shape (4, 4).
        link: link of the description.
    """
    top = model.tops[link]
    if top.body_link == model.base:
        return -1, pose_row(T_world_base @ top.T_body_frame)
    child = [model.joints[name].child for name in joints]
    return child.index(top.body_link), pose_row(top.T_body_frame)
