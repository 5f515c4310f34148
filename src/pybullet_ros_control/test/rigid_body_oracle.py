"""A second opinion on the physics: pinocchio's forward dynamics, integrated by Runge-Kutta of fourth order, torques
held for 1 ms."""

import re

import numpy as np
import pinocchio


def wide(urdf):
    """Return the same robot without joint limits that it could reach."""
    return re.sub(r'lower="[^"]*" upper="[^"]*"', 'lower="-1000" upper="1000"', urdf)


class Oracle:
    """A robot with rotor inertia and damping, without contact and stops."""

    def __init__(self, urdf, rotor_inertia=0.0, damping=0.0, control_period=1e-3, steps_per_period=4):
        self.model = pinocchio.buildModelFromXML(urdf)
        self.model.armature = np.full(self.model.nv, rotor_inertia)
        self.damping = damping
        self.data = self.model.createData()
        self.period, self.n = control_period, steps_per_period

    def acceleration(self, q, dq, tau):
        return pinocchio.aba(self.model, self.data, q, dq, tau - self.damping * dq)

    def middle_acceleration(self, q, dq, tau, losses=lambda u: 0.0):
        """x with bias and losses at the velocity dq + dt/2 x, to the last digits (implicit midpoint rule at a given
        position)."""
        x = np.zeros_like(dq)
        M = self.mass_matrix(q) + np.diag(self.model.armature)
        for _ in range(100):
            u = dq + 0.5 * self.period * x
            x = 0.5 * (x + np.linalg.solve(M, tau - losses(u) - self.damping * u - self.bias(q, u)))
        return x

    def mass_matrix(self, q):
        """Return the mass matrix of the links alone; pinocchio's crba adds the rotors to its diagonal."""
        upper = np.triu(pinocchio.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T - np.diag(self.model.armature)

    def bias(self, q, dq):
        return pinocchio.nonLinearEffects(self.model, self.data, q, dq).copy()

    def gravity(self, q):
        return pinocchio.computeGeneralizedGravity(self.model, self.data, q).copy()

    def frame(self, q, name):
        pinocchio.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.model.getFrameId(name)].homogeneous.copy()

    def jacobian(self, q, name):
        """Return the Jacobian at the frame's origin in world axes, shape (6, n)."""
        frame = self.model.getFrameId(name)
        return pinocchio.computeFrameJacobian(self.model, self.data, q, frame, pinocchio.LOCAL_WORLD_ALIGNED).copy()

    def hold(self, q, dq, tau):
        """Return the state after one control period with constant torques tau."""
        h = self.period / self.n
        for _ in range(self.n):
            a1 = self.acceleration(q, dq, tau)
            a2 = self.acceleration(q + h / 2 * dq, dq + h / 2 * a1, tau)
            a3 = self.acceleration(q + h / 2 * dq + h * h / 4 * a1, dq + h / 2 * a2, tau)
            a4 = self.acceleration(q + h * dq + h * h / 2 * a2, dq + h * a3, tau)
            q = q + h * dq + h * h / 6 * (a1 + a2 + a3)
            dq = dq + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        return q, dq

    def pd_run(self, goal, kp, kd, duration, q):
        """Positions at the control instants under tau = kp (goal - q) - kd dq + g(q), shape (steps + 1, n)."""
        dq = np.zeros_like(q)
        positions = [q]
        for _ in range(round(duration / self.period)):
            q, dq = self.hold(q, dq, kp * (goal - q) - kd * dq + self.gravity(q))
            positions.append(q)
        return np.array(positions)


def plant_pd_run(plant, gravity, goal, kp, kd, duration):
    """Run the same law on a plant; return the positions that the controller reads, shape (steps + 1, n)."""
    n = len(goal)
    q, dq, tau = [0.0] * n, [0.0] * n, [0.0] * n
    positions = []
    for _ in range(round(duration / plant.time_step) + 1):
        plant.read_state(q, dq, tau)
        positions.append(q[:])
        x = np.array(q)
        plant.apply(kp * (goal - x) - kd * np.array(dq) + gravity(x))
        plant.step()
    return np.array(positions)
