"""Reference dynamics of a robot description by pinocchio, in which mimic joints are eliminated by the Jacobian of their
laws: J'M J z'' = J'(tau - h)."""

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import pinocchio

FloatArray = npt.NDArray[np.float64]
MOVING = ("revolute", "continuous", "prismatic")
"""Types of joints with one coordinate."""


class Oracle:
    """Dynamics of a robot with a fixed base, without contact, stops, friction and rotor inertia.

    Vectors of all joints are in pinocchio's order; vectors of the independent joints leave out mimic joints.

    Args:
        urdf: robot description as URDF text.

    Attributes:
        names: names of all moving joints.
        independent: names of the joints that do not mimic others.
        J: derivative of all joint positions by those of the independent joints, shape (n, r).
        offset: joint positions if all independent joints are at zero, shape (n,) [rad or m].
    """

    def __init__(self, urdf: str) -> None:
        self._model = pinocchio.buildModelFromXML(urdf)
        self._data = self._model.createData()
        self.names: list[str] = list(self._model.names)[1:]
        elements = {joint.get("name", ""): joint for joint in ElementTree.fromstring(urdf).findall("joint")}
        self.elements = {name: elements[name] for name in self.names}
        self.independent = [name for name in self.names if elements[name].find("mimic") is None]
        self.J, self.offset = np.zeros((len(self.names), len(self.independent))), np.zeros(len(self.names))
        for i, name in enumerate(self.names):
            scale = 1.0
            while (mimic := elements[name].find("mimic")) is not None:
                self.offset[i] += scale * float(mimic.get("offset", "0"))
                scale *= float(mimic.get("multiplier", "1"))
                name = mimic.get("joint", "")
            self.J[i, self.independent.index(name)] = scale
        losses = [element.find("dynamics") for element in self.elements.values()]
        self._damping = np.array([0.0 if loss is None else float(loss.get("damping", "0")) for loss in losses])

    def positions(self, z: FloatArray) -> FloatArray:
        """Return the positions of all joints, shape (n,) [rad or m]."""
        return self.J @ z + self.offset

    def _configuration(self, z: FloatArray) -> FloatArray:
        """Return pinocchio's configuration vector, which has cosine and sine of continuous joints."""
        q = np.zeros(self._model.nq)
        for joint, x in zip(list(self._model.joints)[1:], self.positions(z), strict=True):
            q[joint.idx_q : joint.idx_q + joint.nq] = x if joint.nq == 1 else (np.cos(x), np.sin(x))
        return q

    def mass_matrix(self, z: FloatArray) -> FloatArray:
        """Return the mass matrix of the independent joints, shape (r, r) [kg m^2, kg m, kg]."""
        upper = np.triu(pinocchio.crba(self._model, self._data, self._configuration(z)))
        return np.asarray(self.J.T @ (upper + np.triu(upper, 1).T) @ self.J)

    def acceleration(self, z: FloatArray, dz: FloatArray, tau: FloatArray) -> FloatArray:
        """Return the accelerations of the independent joints for their efforts; all arguments have shape (r,)."""
        dq = self.J @ dz
        bias = pinocchio.nonLinearEffects(self._model, self._data, self._configuration(z), dq) + self._damping * dq
        return np.asarray(np.linalg.solve(self.mass_matrix(z), tau - self.J.T @ bias))

    def step(self, z: FloatArray, dz: FloatArray, tau: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """Return the state after a time h with constant efforts, by a Runge-Kutta step of fourth order."""
        a1 = self.acceleration(z, dz, tau)
        a2 = self.acceleration(z + h / 2 * dz, dz + h / 2 * a1, tau)
        a3 = self.acceleration(z + h / 2 * dz + h * h / 4 * a1, dz + h / 2 * a2, tau)
        a4 = self.acceleration(z + h * dz + h * h / 2 * a2, dz + h * a3, tau)
        return z + h * dz + h * h / 6 * (a1 + a2 + a3), dz + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def pose(self, z: FloatArray, link: str) -> FloatArray:
        """Return the pose of a link in the root link, shape (4, 4)."""
        pinocchio.framesForwardKinematics(self._model, self._data, self._configuration(z))
        return np.asarray(self._data.oMf[self._model.getFrameId(link)].homogeneous)


def ends(elements: Sequence[ElementTree.Element]) -> list[tuple[float, float]]:
    """Return the range of each joint [rad or m]; a revolution or a metre for an unlimited joint."""
    found = []
    for element in elements:
        limit, unbounded = element.find("limit"), element.get("type") == "continuous"
        low, high = (0.0, 0.0) if limit is None else (float(limit.get(end, "0")) for end in ("lower", "upper"))
        found.append((-3.0, 3.0) if unbounded else (max(low, -3.0), min(high, 3.0)))
    return found
