"""MuJoCo arm model for the fit of muscles: actuators with MuJoCo's muscle gain on a tendon are its muscles."""

from collections.abc import Mapping
from pathlib import Path

import mujoco
import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.fitting.model import ArmModel, Coordinate, Strengths

_SITE, _PULLEY = -1, -2
"""Values of `wrap_obj` in MuJoCo's data that are not a wrapped geometry."""
_SHIFT = 1e-5
"""Shift of a body in the numerical derivative that gives the muscles' forces across its joint [m]."""


class MujocoArm(ArmModel):
    """MuJoCo model of an arm. Equality constraints between joints are evaluated; other constraints are ignored.

    Raises:
        HricError: MuJoCo cannot read the model, or it has no muscles.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            raise HricError(f"{path} is no MuJoCo model: {str(error).splitlines()[0]}") from error
        model = self._model
        self._data = mujoco.MjData(model)
        self.name, self.credits = path.stem, ""
        self._actuators = [
            k
            for k in range(model.nu)
            if model.actuator_gaintype[k] == mujoco.mjtGain.mjGAIN_MUSCLE
            and model.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_TENDON
        ]
        self.muscles = [model.actuator(k).name for k in self._actuators]
        if not self.muscles:
            raise HricError(f"{path} has no muscles: no actuator with MuJoCo's muscle gain on a tendon")
        self._tendons = model.actuator_trnid[self._actuators, 0]
        names = ["", *(model.body(i).name or f"body {i}" for i in range(1, model.nbody))]
        self._bodies = {name: i for i, name in enumerate(names)}
        self.parents = {names[i]: names[model.body_parentid[i]] for i in range(1, model.nbody)}
        self._equal = [
            e for e in range(model.neq) if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[e]
        ]
        dependent = {int(model.eq_obj1id[e]) for e in self._equal}
        self.coordinates = [
            self._coordinate(j, names[model.jnt_bodyid[j]])
            for j in range(model.njnt)
            if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE and j not in dependent and model.joint(j).name
        ]
        down = model.opt.gravity
        self.up = -down / np.linalg.norm(down) if np.any(down) else np.array([0.0, 0.0, 1.0])
        self.put({})

    def _coordinate(self, joint: int, body: str) -> Coordinate:
        model = self._model
        low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.pi, np.pi)
        default = float(np.clip(model.qpos0[model.jnt_qposadr[joint]], low, high))
        return Coordinate(model.joint(joint).name, body, float(low), float(high), default)

    def put(self, angles: Mapping[str, float]) -> None:
        """Set coordinates by name [rad]; the others do not change."""
        model, qpos = self._model, self._data.qpos
        for name, angle in angles.items():
            qpos[model.joint(name).qposadr[0]] = angle
        for e in self._equal:
            first, second = model.jnt_qposadr[model.eq_obj1id[e]], model.eq_obj2id[e]
            at = 0.0
            if second >= 0:
                other = model.jnt_qposadr[second]
                at = qpos[other] - model.qpos0[other]
            qpos[first] = model.qpos0[first] + np.polyval(model.eq_data[e, 4::-1], at)
        self._update()

    def _update(self) -> None:
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_tendon(self._model, self._data)

    def frame(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return rotation, shape (3, 3), and origin [m] of a body in the ground frame."""
        i = self._bodies[body]
        return np.array(self._data.xmat[i]).reshape(3, 3), np.array(self._data.xpos[i])

    def centre(self, body: str) -> FloatArray:
        """Return the position of the joint between a body and its parent, in the ground frame [m]."""
        i = self._bodies[body]
        return np.array(
            self._data.xanchor[self._model.body_jntadr[i]] if self._model.body_jntnum[i] else self._data.xpos[i]
        )

    def mass_centre(self, body: str) -> FloatArray:
        """Return the centre of mass of a body in the ground frame [m]."""
        return np.array(self._data.xipos[self._bodies[body]])

    def lengths(self) -> FloatArray:
        """Return the lengths of the muscles including their tendons, shape (K,) [m]."""
        return np.array(self._data.ten_length[self._tendons])

    def muscle_paths(self) -> list[list[tuple[str, FloatArray]]]:
        """Return the points of each muscle's path; where a tendon wraps around a geometry, both ends of that part."""
        model, data = self._model, self._data
        names, positions = list(self._bodies), data.wrap_xpos.reshape(-1, 3)
        paths = []
        for tendon in self._tendons:
            of = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
            sites = iter(model.wrap_objid[of][model.wrap_type[of] == mujoco.mjtWrap.mjWRAP_SITE])
            points = list[tuple[str, FloatArray]]()
            for k in range(data.ten_wrapadr[tendon], data.ten_wrapadr[tendon] + data.ten_wrapnum[tendon]):
                geom = data.wrap_obj.flat[k]
                if geom != _PULLEY:
                    body = model.site_bodyid[next(sites)] if geom == _SITE else model.geom_bodyid[geom]
                    points.append((names[body], positions[k].copy()))
            paths.append(points)
        return paths

    def pulls(self, body: str) -> FloatArray:
        """Return each muscle's total force on a body and all distal ones, per muscle force, in ground axes [1].

        It is the derivative of the muscle's length as the body is shifted away from its parent (virtual work).
        """
        number, R_ground_parent = self._bodies[body], self.frame(self.parents[body])[0]
        rows = []
        for axis in np.eye(3):
            lengths = []
            for shift in (_SHIFT, -_SHIFT):
                at = self._model.body_pos[number].copy()
                self._model.body_pos[number] += shift * R_ground_parent.T @ axis
                self._update()
                lengths.append(self.lengths())
                self._model.body_pos[number] = at
            rows.append((lengths[1] - lengths[0]) / (2.0 * _SHIFT))
        self._update()
        return np.array(rows).T

    def strengths(self) -> Strengths:
        """Return force and length parameters from MuJoCo's: its length range is that of fibres plus rigid tendon."""
        model, of = self._model, self._actuators
        shortest, longest, force, scale = model.actuator_gainprm[of, :4].T
        low, high = model.actuator_lengthrange[of].T
        optimal = (high - low) / (longest - shortest)
        return Strengths(
            np.where(force < 0.0, scale / model.actuator_acc0[of], force), optimal, low - shortest * optimal
        )
