"""How readily a point of a body gives way: its inverse effective mass, with joints, brakes and rotors."""

from __future__ import annotations

import numpy as np
import pybullet

from hric_control.plants.spatial import FloatArray, cross, rotation_from_quaternion
from pybullet_ros_control.engine import Body, Engine
from pybullet_ros_control.joint_rows import JointRows
from pybullet_ros_control.robot import Robot


class Mobility:
    """Bodies of one engine, the robot among them.

    Args:
        engine: where they are.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self.clear()

    def clear(self) -> None:
        """Bodies came or went."""
        self._rows: dict[int, JointRows] = {}
        self._masses: dict[int, tuple[float, FloatArray]] = {}
        self._inertias: dict[int, FloatArray] = {}

    def begin(self, robot: Robot, rows: JointRows) -> None:
        """A new step; rows: of the robot."""
        self._robot = robot
        self._inertias.clear()
        for of_body in self._rows.values():
            of_body.forget()
        self._rows[robot.body.id] = rows

    def inverse_mass(self, body: Body, index: int, point: FloatArray, normal: FloatArray) -> float:
        """n' J (M + B)^-1 J' n of a point of a link, shape (3,) [m], along a unit vector, shape (3,) [1/kg].

        A free body with joints counts as one mass at the point.
        """
        mass, moments = self._mass(body)
        if mass > 0.0 and not body.joints:
            return self._of_free_body(body, mass, moments, point, normal)
        if mass > 0.0:
            return 1.0 / mass
        if not body.joints or index < 0:
            return 0.0
        if body.id not in self._rows:
            self._rows[body.id] = JointRows(body, self._engine.client)
        row = self._rows[body.id].efforts(index, normal, None, point)
        return float(row @ self._inverse_inertia(body) @ row)

    def _mass(self, body: Body) -> tuple[float, FloatArray]:
        """(mass [kg], principal moments, shape (3,) [kg m^2]) of a free body; mass 0: its base is fixed."""
        if body.id not in self._masses:
            client = self._engine.client
            base = pybullet.getDynamicsInfo(body.id, -1, physicsClientId=client)
            links = [pybullet.getDynamicsInfo(body.id, i, physicsClientId=client)[0] for i in body.links.values() if i >= 0]
            self._masses[body.id] = (base[0] + sum(links) if base[0] > 0.0 else 0.0), np.array(base[2])
        return self._masses[body.id]

    def _of_free_body(self, body: Body, mass: float, moments: FloatArray, point: FloatArray, normal: FloatArray) -> float:
        centre, orientation = pybullet.getBasePositionAndOrientation(body.id, physicsClientId=self._engine.client)
        lever = cross(point - centre, normal) @ rotation_from_quaternion(orientation)
        return float(1.0 / mass + (lever * lever) @ (1.0 / moments))

    def _inverse_inertia(self, body: Body) -> FloatArray:
        """(M + B)^-1 of the joints, shape (n, n); those that are held do not answer."""
        if body.id not in self._inertias:
            robot = self._robot
            if body.id == robot.body.id:
                M = np.array(robot.mass_matrix(robot.q)) + np.diag(robot.rotor_inertia)
                free = robot.free_joints
            else:
                states = pybullet.getJointStates(body.id, self._rows[body.id].joints, self._engine.client)
                M = np.array(pybullet.calculateMassMatrix(body.id, [state[0] for state in states], physicsClientId=self._engine.client))
                free = list(range(len(M)))
            inverse = np.zeros_like(M)
            if free:
                inverse[np.ix_(free, free)] = np.linalg.inv(M[np.ix_(free, free)])
            self._inertias[body.id] = inverse
        return self._inertias[body.id]
