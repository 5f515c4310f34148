"""Forward dynamics with rotor inertia, brakes and constraints, from OpenSim's own acceleration and mass matrix.

The OpenSim model has only the links: its acceleration a solves  M a = f + G' lambda,  with all forces of the model in f
(gravity, velocity terms, damping) and the constraint Jacobian G. Rotors add the inertia B = diag(b), and the efforts
tau act in the joints in addition. So the acceleration x of the plant solves
    (M + B) x = f + tau + G' mu,   G x = G a.
f need not be known: M a differs from it by G' lambda, which can be included in mu, so (M + B) x = M a + tau + G' nu.
Braked joints have x = 0 and are removed from the equations; the residual of their rows is the effort of the brake.
"""

from collections.abc import Sequence

import numpy as np

from hric_control.plant import FloatArray
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.stages import balance, rubbed, solve


class EquationsOfMotion:
    """Equations of motion (du/dt) of one model.

    Args:
        engine: engine with the model.
        inertia: rotor inertias, shape (nu,) [kg m^2].
        friction: parameters of the sigmoid friction of each coordinate, as rows for `stages.rubbed`; None: no friction.

    Attributes:
        rotors: rotor inertias, shape (nu,) [kg m^2].
        inertia: inertia that is added to the mass matrix in a step, shape (nu,) [kg m^2]: that of the rotors, or more
            if friction at rest acts.
    """

    def __init__(self, engine: OpenSimEngine, inertia: FloatArray, friction: FloatArray | None) -> None:
        self.engine, self._friction = engine, friction
        self.rotors = self.inertia = inertia
        self._bare = not inertia.any() and not engine.constraints
        self._all = np.arange(engine.nu, dtype=np.intp)
        self._pull = np.zeros(engine.nu)  # G' nu of the last evaluation
        self.brake(())

    def brake(self, braked: Sequence[int]) -> None:
        """Close the brakes of these coordinates, by index, and open all others."""
        self._braked = sorted(braked)
        self._free = np.setdiff1d(self._all, np.array(self._braked, dtype=np.intp)) if self._braked else self._all

    def evaluate(self, y: FloatArray, tau: FloatArray) -> FloatArray:
        """Return du/dt in the state y under the joint efforts tau, shape (nu,), all in the engine's order."""
        engine = self.engine
        engine.put_y(y)
        self._a = a = engine.acceleration()
        if self._friction is not None:
            tau = rubbed(tau, y[engine.nu : 2 * engine.nu], self._friction)
        if self._bare and self.inertia is self.rotors and not self._braked:
            return a + engine.divided_by_mass(tau)
        self._A, self._drive = balance(engine.mass_matrix(), self.inertia, a, tau)
        if not self._braked and not engine.constraints:
            return self._solve(self._A, self._drive)
        return self._constrained(self._drive)

    @staticmethod
    def _solve(A: FloatArray, b: FloatArray) -> FloatArray:
        x = solve(A, b)
        # Not positive definite: a description with physically impossible inertia tensors.
        return np.asarray(np.linalg.solve(A, b)) if x is None else x

    def _constrained(self, drive: FloatArray) -> FloatArray:
        free, x = self._free, np.zeros_like(drive)
        if len(free) == 0:
            return x
        A = self._A[np.ix_(free, free)]
        if not self.engine.constraints:
            x[free] = self._solve(A, drive[free])
            return x
        G = self.engine.constraint_jacobian()
        W = self._solve(A, np.ascontiguousarray(G[:, free].T))
        x0 = self._solve(A, drive[free])
        # Least squares: with braked joints, constraints may have no free coordinate.
        nu = np.linalg.lstsq(G[:, free] @ W, G @ self._a - G[:, free] @ x0, rcond=None)[0]
        x[free] = x0 + W @ nu
        self._pull = G.T @ nu
        return x

    def response(self) -> FloatArray:
        """Return the change of du/dt per effort in the last evaluated state, shape (nu, nu); 0 for braked joints."""
        n, free = self.engine.nu, self._free
        K = np.zeros((n, n))
        A = (self.engine.mass_matrix() + np.diag(self.inertia))[np.ix_(free, free)]
        inverse = np.linalg.inv(A)
        if self.engine.constraints:
            G = self.engine.constraint_jacobian()[:, free]
            W = inverse @ G.T
            inverse = inverse - W @ np.linalg.pinv(G @ W) @ W.T
        K[np.ix_(free, free)] = inverse
        return K

    def brake_efforts(self, x: FloatArray) -> FloatArray:
        """Return the efforts of the brakes in the last evaluated state, shape (nu,), 0 for free joints [N m].

        x: result of the last `evaluate`.
        """
        efforts = np.zeros_like(x)
        efforts[self._braked] = (self._A @ x - self._drive - self._pull)[self._braked]
        return efforts

    def stopped(self, y: FloatArray) -> FloatArray:
        """Return the state right after the brakes closed in the state y: braked joints are at rest.

        The impulse of the stop also changes the speeds of the other joints.
        """
        n, braked = self.engine.nu, self._braked
        u = y[n : 2 * n]
        if not braked or not u[braked].any():
            return y
        self.engine.put_y(y)
        self.engine.acceleration()
        M = self.engine.mass_matrix() + np.diag(self.rotors)
        free = self._free
        A, new = M[np.ix_(free, free)], np.zeros(n)
        new[free] = u[free] + np.linalg.solve(A, M[free][:, braked] @ u[braked])
        if self.engine.constraints:
            G = self.engine.constraint_jacobian()[:, free]
            W = np.linalg.solve(A, G.T)
            new[free] -= W @ np.linalg.lstsq(G @ W, G @ new[free], rcond=None)[0]
        after = y.copy()
        after[n : 2 * n] = new
        return after
