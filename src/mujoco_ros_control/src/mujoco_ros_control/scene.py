"""Compiled MuJoCo scene with its state: lookup by name, and transfer of the state to a newly compiled scene."""

from collections.abc import Collection, Iterable, Mapping, Sequence

import mujoco
import numpy as np

from hric_control.plants import reciprocals
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, homogeneous
from hric_core.geometry.quaternions import cross
from mujoco_ros_control.joints import install_laws
from mujoco_ros_control.scene_spec import UNSOLVED, Geom, Law, SceneSpec

INTEGRATORS = {
    "accurate": mujoco.mjtIntegrator.mjINT_RK4,
    "semi_implicit": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}
HARD = [0.99, 0.999, 0.001, 0.5, 2.0]
"""MuJoCo's constraint impedance (solimp) of rigid contact and joint stops (project default, unconfirmed)."""
STICKING = [0.9999, 0.9999, 0.001, 0.5, 2.0]
"""MuJoCo's constraint impedance (solimp) of Coulomb friction and mimic joints; the maximum that MuJoCo allows.

With it, joints that are held by friction creep by 5e-6 rad in 60 s.
"""

JointState = tuple[FloatArray, FloatArray]
"""Positions and velocities of one joint, in MuJoCo's layout."""


def _be_silent(_: str) -> None:
    """Ignore MuJoCo's warnings, which it would write to a file in the working folder; the plant checks each step."""


mujoco.set_mju_user_warning(_be_silent)


class CompiledScene:
    """Compiled MuJoCo scene, initially in its start state.

    Args:
        built: specification of the scene.
        time_step: duration of a step [s].
        gravity: gravity in the world frame, 3 floats [m/s^2].
        integrator: key of INTEGRATORS.

    Attributes:
        m, d: MuJoCo's model and data.
        bodies: MuJoCo id of each body by name.
        links: "model::link" of each geom, by the geom's id.
        springs: pairs of shapes with penalty contact, by the ids of the two geoms in either order: (a, b, law, True if
            a is the first of the two ids).
        apart: pairs of geoms, by their ids in either order, that must not touch.
        semi_implicit: True if positions belong to an instant half a step later than velocities.

    Raises:
        HricError: MuJoCo cannot compile the scene.
    """

    def __init__(self, built: SceneSpec, time_step: float, gravity: Sequence[float], integrator: str) -> None:
        self.built, self.semi_implicit = built, integrator == "semi_implicit"
        option = built.spec.option
        option.timestep, option.gravity, option.integrator = time_step, gravity, INTEGRATORS[integrator]
        option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        option.tolerance, option.iterations = 1e-10, 100
        # A diverged state would silently restart from zero.
        option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
        try:
            self.m = built.spec.compile()
        except ValueError as error:
            raise HricError(f"MuJoCo cannot compile the scene: {error}") from error
        self._set_constraints(2.0 * time_step)
        self.d = mujoco.MjData(self.m)
        self.bodies = {self.m.body(i).name: i for i in range(self.m.nbody)}
        self.links = [built.geoms[self.m.geom(i).name].link for i in range(self.m.ngeom)]
        for name, moments in built.moments.items():
            self.m.body_inertia[self.bodies[name]] = moments
        if built.moments:
            mujoco.mj_setConst(self.m, self.d)
            mujoco.mj_resetData(self.m, self.d)
        self.springs = self._numbered_springs()
        self._reaches = self.m.pair_margin.copy(), self.m.pair_gap.copy()
        self.apart = set[tuple[int, int]]()
        self._still, self._connected = frozenset[int](), frozenset[frozenset[str]]()
        self._dofs_between = self._between_pairs()
        self._joints = {self.m.joint(i).name: self._slices(i) for i in range(self.m.njnt)}
        self._laws = self._rows_of_laws()
        if len(self._laws):
            install_laws()

    def _rows_of_laws(self) -> FloatArray:
        """Return the matrix G of all mimic laws, G v = 0 for the velocities v, shape (laws, nv)."""
        m = self.m
        G = np.zeros((m.neq, m.nv))
        for row, ends in enumerate(zip(m.eq_obj1id, m.eq_obj2id, strict=True)):
            G[row, m.jnt_dofadr[list(ends)]] = 1.0, -m.eq_data[row, 1]
        return G

    def _set_constraints(self, time_constant: float) -> None:
        """Make all constraints as hard as the step allows; time_constant: of their errors' decay [s]."""
        m, hard = self.m, [time_constant, 1.0]
        m.pair_solref[:] = m.jnt_solref[:] = m.eq_solref[:] = m.dof_solref[:] = hard
        m.pair_solimp[:] = m.jnt_solimp[:] = HARD
        m.dof_solimp[:] = m.eq_solimp[:] = STICKING

    def _numbered_springs(self) -> dict[tuple[int, int], tuple[Geom, Geom, Law, bool]]:
        """Return the springs by both orders of geom numbers: MuJoCo reports contacts with the simpler shape first."""
        springs = {}
        for a, b, law in self.built.springs:
            first, second = (self.m.geom(geom.name).id for geom in (a, b))
            springs[first, second], springs[second, first] = (a, b, law, True), (a, b, law, False)
        return springs

    def _between_pairs(self) -> list[frozenset[int]]:
        """Return, for each pair of shapes, the indices of the velocities that move them relative to each other."""
        m = self.m
        moved: list[frozenset[int]] = []
        for body in range(m.nbody):
            dofs = range(m.body_dofadr[body], m.body_dofadr[body] + m.body_dofnum[body])
            moved.append((moved[m.body_parentid[body]] if body else frozenset()) | frozenset(dofs))
        pairs = zip(m.pair_geom1.tolist(), m.pair_geom2.tolist(), strict=True)
        return [moved[m.geom_bodyid[a]] ^ moved[m.geom_bodyid[b]] for a, b in pairs]

    def set_still(self, dofs: Collection[int]) -> None:
        """Set the velocities (by index) that brakes hold at zero.

        A contact between shapes that only these could separate has an indeterminate force; MuJoCo then reports it but
        does not solve it.
        """
        self._still = frozenset(dofs)
        self._send_pairs()

    def set_connected(self, pairs: Iterable[tuple[str, str]]) -> None:
        """Set the pairs of links, by "model::link", that must not touch, since bushings connect them."""
        self._connected = frozenset(map(frozenset, pairs))
        self._send_pairs()

    def _send_pairs(self) -> None:
        """Set the contact margin of each pair in MuJoCo, which decides if contact is solved, only reported, or off."""
        m = self.m
        m.pair_margin[:], m.pair_gap[:] = self._reaches
        pairs = zip(m.pair_geom1.tolist(), m.pair_geom2.tolist(), strict=True)
        self.apart.clear()
        for k, (geoms, between) in enumerate(zip(pairs, self._dofs_between, strict=True)):
            if frozenset(self.links[geom] for geom in geoms) in self._connected:
                m.pair_margin[k], m.pair_gap[k] = -UNSOLVED, 0.0
                self.apart |= {geoms, geoms[::-1]}
            elif geoms not in self.springs and between.issubset(self._still):
                m.pair_margin[k], m.pair_gap[k] = -UNSOLVED, UNSOLVED

    def _slices(self, joint: int) -> tuple[slice, slice]:
        free = self.m.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        q, v = int(self.m.jnt_qposadr[joint]), int(self.m.jnt_dofadr[joint])
        return slice(q, q + (7 if free else 1)), slice(v, v + (6 if free else 1))

    def dofs(self, joints: Sequence[str]) -> list[int]:
        """Return the indices of joints with one coordinate in MuJoCo's velocities (qvel)."""
        return [self._joints[name][1].start for name in joints]

    def positions(self, joints: Sequence[str]) -> list[int]:
        """Return the indices of joints with one coordinate in MuJoCo's positions (qpos)."""
        return [self._joints[name][0].start for name in joints]

    def joint_ids(self, joints: Sequence[str]) -> list[int]:
        """Return the MuJoCo ids of joints."""
        return [self.m.joint(name).id for name in joints]

    def states(self) -> dict[str, JointState]:
        """Return the states of all joints by name."""
        return {name: (self.d.qpos[q].copy(), self.d.qvel[v].copy()) for name, (q, v) in self._joints.items()}

    def put(self, states: Mapping[str, JointState]) -> None:
        """Set the states of the named joints that exist in this scene."""
        for name, (q, v) in states.items():
            if name in self._joints:
                at, of = self._joints[name]
                self.d.qpos[at], self.d.qvel[of] = q, v

    def put_free(self, joint: str, linear: Sequence[float], angular: Sequence[float]) -> None:
        """Set the velocity of a free body's origin, world axes [m/s], [rad/s].

        MuJoCo itself expects the angular velocity in body axes.
        """
        at, of = self._joints[joint]
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, self.d.qpos[at][3:])
        self.d.qvel[of] = [*linear, *(R.reshape(3, 3).T @ np.array(angular))]

    def update(self) -> None:
        """Update positions and velocities of all bodies to the present joint state, which a step does not do."""
        mujoco.mj_kinematics(self.m, self.d)
        mujoco.mj_comPos(self.m, self.d)
        mujoco.mj_comVel(self.m, self.d)

    def response(self, efforts: FloatArray) -> FloatArray:
        """Return the accelerations that efforts alone would cause, with mimic laws, shape (n, nv).

        The mass matrix is that of the last update within a step.

        Args:
            efforts: n sets of generalised efforts, shape (n, nv) [N m or N].
        """
        solved = np.empty_like(efforts)
        mujoco.mj_solveM(self.m, self.d, solved, efforts)
        G = self._laws
        if len(G):
            W = np.empty_like(G)
            mujoco.mj_solveM(self.m, self.d, W, G)
            solved -= np.linalg.solve(G @ W.T, G @ solved.T).T @ W
        return solved

    def inertias(self, dofs: Sequence[int]) -> list[float]:
        """Return the effective inertia 1 / (M^-1)_ii of each of these velocities [kg m^2 or kg]; 0 if immobile."""
        rows = np.zeros((len(dofs), self.m.nv))
        rows[range(len(dofs)), dofs] = 1.0
        return reciprocals((rows * self.response(rows)).sum(axis=1))

    def pose(self, body: int) -> FloatArray:
        """Return the pose of a body in the world at the last update, shape (4, 4); body: MuJoCo id."""
        return homogeneous(self.d.xmat[body].reshape(3, 3), self.d.xpos[body])

    def link_pose(self, link: str) -> FloatArray:
        """Return the pose of a link ("model::link") in the world at the last update, shape (4, 4)."""
        frame = self.built.frames[link]
        return self.pose(self.bodies[frame.body]) @ frame.T_body_link

    def twist(self, body: int, point: FloatArray) -> FloatArray:
        """Return the twist of a body's material at a point [m], linear then angular, world axes, shape (6,)."""
        result = np.empty(6)  # angular, linear, about the origin of the body
        mujoco.mj_objectVelocity(self.m, self.d, mujoco.mjtObj.mjOBJ_XBODY, body, result, 0)
        about_point = cross(result[:3].tolist(), (point - self.d.xpos[body]).tolist())
        return np.concatenate([result[3:] + np.array(about_point), result[:3]])
