"""Joint efforts that make PyBullet's step second-order accurate and add the rotor inertia and friction that it lacks.

With the joint acceleration x, PyBullet solves  M x = tau' + tau_ext + tau_eng - h(q, v)  and steps by v += dt x,
q += dt v (semi-implicit Euler). Its position belongs to the middle of the coming step, its velocity to the start; so
the bias h (Coriolis and gravity) and the friction f must be evaluated at the velocity u in the middle:
    (M + B) x = tau + tau_ext + tau_eng - h(q, u) - f(u),   u = v + dt/2 x   (implicit midpoint rule, two passes for u)
The efforts that are sent to the engine lead to this x:
    tau' = tau - B x - f(u) + h(q, v) - h(q, u)
B = diag(b): rotor inertia. f: damping and the identified sigmoid, linearised in x in each pass, so that damping of any
size is stable. Coulomb friction is the effort within its bounds that comes nearest to stopping each joint in this
step. tau_ext: efforts of forces that the plant applies itself, known in advance. tau_eng: efforts that the engine adds
(rigid contact, joint stops). They are known only after the step, from the difference to the predicted velocity:
    tau_eng(k) = tau_eng(k-1) + M (v - v_predicted) / dt.
Joints whose acceleration is prescribed (brakes, drives) are removed from the equations: the engine's motor supplies
their effort. So are mimic joints, x = J z: J'(M + B) J z = J'(...); tau' contains the efforts that keep their x on the
mimic law, and a gear constraint of the engine distributes contact and stop forces to both joints.

Consequences: a static press is exact. At a joint stop or a fixed rigid object, the impulse converges to that of M + B
within a few steps. Against a free rigid object it does not, since the engine separates the two after the impulse of
the links without rotors. Penalty contact is known in advance and exact in both cases.
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

In the thesis's experiment with a step setpoint (Kp 50, 4 s), a third one changes the joint positions by at most
1.5e-7 rad, and by 1e-9 rad with rotor inertia; a single one leaves an error of 5e-6 rad.
"""

Triple = tuple[float, float, float]
LinkMotion = tuple[Triple, tuple[float, float, float, float], Triple, Triple]
"""Position [m], quaternion (x, y, z, w), linear [m/s] and angular velocity [rad/s] of a frame, in the world."""


class CompiledDynamics(Protocol):
    """Compiled joint dynamics of one robot, which remembers the previous step.

    Vectors are n floats in the engine's order of the moving joints.
    """

    def torque(
        self, q: Vector, dq: Vector, tau: Vector, external: Vector | None, prescribed: Sequence[float | None] | None, /
    ) -> list[float]:
        """Return the joint efforts to send to the engine for the coming step [N m].

        Args:
            q: the engine's present position [rad].
            dq: the engine's present velocity [rad/s].
            tau: efforts of the motors [N m].
            external: efforts of the forces that the plant applies in this step [N m]; None: no forces.
            prescribed: acceleration of each joint that a motor of the engine enforces [rad/s^2], None for other
                joints; None: no such joint. The result for an enforced joint has only the efforts that its mimic
                joints need.
        """

    def read(
        self, states: Sequence[Sequence[Any]], tau: Vector, /
    ) -> tuple[list[float], list[float], list[float], list[float], bool]:
        """Return the state after the step, from the result of PyBullet's `getJointStates`.

        Args:
            states: result of `getJointStates`.
            tau: efforts of the motors in the step [N m].

        Returns:
            Positions and velocities of the engine, positions at the measuring instant, efforts on the link side of the
            rotors, and True if all are finite and no joint is faster than `quiet`.
        """

    def rotor_efforts(self, dq: Vector, /) -> list[float]:
        """Return the efforts that accelerated the rotors in the step that ended with the velocities dq [N m]."""

    def forget(self) -> None:
        """Clear the memory of the previous step, after the state was set from outside."""

    def mass_matrix(self, q: Vector, /) -> list[float]:
        """Return the mass matrix of the links at q, without mimic laws, n x n floats, row-major [kg m^2]."""

    def mobility(self, q: Vector, /) -> list[float]:
        """Return the inverse mass matrix of the links at q, with mimic laws, n x n floats, row-major [1/(kg m^2)]."""

    def motion(self, q: Vector, dq: Vector, joint: int, frame: Vector, /) -> LinkMotion:
        """Return pose and velocity of a frame on a link, in the world frame.

        Args:
            q: joint positions [rad].
            dq: joint velocities [rad/s].
            joint: index of the last joint that moves the link; -1: none.
            frame: pose of the frame in the link that this joint moves, or in the world if there is none: rotation
                row-major, then position, 12 floats.
        """

    def efforts(self, q: Vector, joint: int, force: Vector, torque: Vector, point: Vector, /) -> list[float]:
        """Return the joint efforts J'F of a force and torque on a link [N m or N].

        Args:
            q: joint positions [rad].
            joint: index of the last joint that moves the link.
            force: force in the world frame, 3 floats [N].
            torque: torque in the world frame, 3 floats [N m].
            point: point of application in the world frame, 3 floats [m].
        """


def half_step(config: PlantConfig) -> float:
    """Return the time by which the engine's positions are ahead of the measuring instant: half a step, or 0 [s]."""
    return 0.5 * config.time_step if config.half_step_readout else 0.0


def added(a: Vector | None, b: Vector) -> Vector:
    """Return the sum a + b of two vectors; a: None counts as zero."""
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
    """Return the compiled joint dynamics of a robot or model.

    Args:
        model: model that is loaded in the engine.
        joints: names of the moving joints in the engine's order, parents before children.
        losses: rotor inertia, damping and friction of these joints.
        gravity: gravity in the world frame, 3 floats [m/s^2].
        time_step: duration of a step [s].
        second_order: True: bias and friction at the middle of the step; False: at its start, as in the engine.
        half: time by which the engine's positions are ahead of the measuring instant [s].
        quiet: speed that no joint reaches unless the simulation diverges [rad/s or m/s].
        T_world_base: pose of the engine's base link, shape (4, 4); None: the description's root link is at the world's
            origin.
        free: True if the base moves; it is then modelled by six additional joints, which come first.
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
    """Return the arguments `joint` and `frame` of `CompiledDynamics.motion` for a link of the description.

    Args:
        model: model that is loaded in the engine.
        joints: names of the moving joints in the engine's order.
        T_world_base: pose of the engine's base link, shape (4, 4).
        link: name of the link in the description.
    """
    top = model.tops[link]
    if top.body_link == model.base:
        return -1, pose_row(T_world_base @ top.T_body_frame)
    return [model.joints[name].child for name in joints].index(top.body_link), pose_row(top.T_body_frame)
