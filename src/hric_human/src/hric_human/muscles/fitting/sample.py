"""Samples of a model's muscles at many poses: lengths, moment arms, and forces on the distal bones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import opensim
from numpy.typing import NDArray
from scipy.stats import qmc

from hric_core.geometry import FloatArray
from hric_human.muscles.polynomial import IntArray

R_LINK_OPENSIM = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation matrix that converts vectors from axes x right, y up, z back to axes x forward, y left, z up."""


@dataclass(frozen=True)
class MuscleSamples:
    """Samples of K muscles at N poses of m joints.

    Attributes:
        q: joint positions, shape (N, m) [rad].
        length: muscle-tendon lengths, shape (N, K) [m].
        arms: moment arms, shape (N, K, m) [m].
        pulls: by joint centre, force on the distal part per unit of muscle force, in axes of the proximal link, shape
            (N, K, 3) [1].
    """

    q: FloatArray
    length: FloatArray
    arms: FloatArray
    pulls: Mapping[str, FloatArray]

    def part(self, rows: slice | NDArray[np.bool_]) -> "MuscleSamples":
        """Return the samples of some of the poses; rows: which."""
        pulls = {centre: pull[rows] for centre, pull in self.pulls.items()}
        return MuscleSamples(self.q[rows], self.length[rows], self.arms[rows], pulls)

    def joined(self, weights: FloatArray) -> "MuscleSamples":
        """Join muscles into lines of action, as weighted means; weights: shape (lines, K), rows add up to 1."""
        pulls = {centre: np.einsum("gk,nkx->ngx", weights, pull) for centre, pull in self.pulls.items()}
        return MuscleSamples(self.q, self.length @ weights.T, np.einsum("gk,nkm->ngm", weights, self.arms), pulls)


def poses(lower: Sequence[float], upper: Sequence[float], count: int) -> FloatArray:
    """Return poses that fill a range of joint angles evenly (Sobol sequence), shape (count, joints) [rad]."""
    points = qmc.Sobol(len(lower), scramble=False).random_base2(max(1, (count - 1).bit_length()))[:count]
    return np.array(lower + points * np.subtract(upper, lower))


class Paths:
    """Muscle paths of an OpenSim model at one set of coordinates.

    Attributes:
        model, state: model and state of OpenSim.
        names: names of the K muscles.
        by_name: coordinates of the model, by name.
    """

    def __init__(self, model: Any) -> None:
        self.model, self.state = model, model.initSystem()
        self.names = [muscle.getName() for muscle in members(model.getMuscles())]
        self._paths = [opensim.GeometryPath.safeDownCast(muscle.getPath()) for muscle in members(model.getMuscles())]
        self._bodies = {body.getName(): (i, body) for i, body in enumerate(members(model.getBodySet()))}
        self.by_name = {str(coordinate.getName()): coordinate for coordinate in members(model.getCoordinateSet())}

    def put(self, angles: Mapping[str, float]) -> None:
        """Set coordinates by name [rad]."""
        for name, angle in angles.items():
            self.by_name[name].setValue(self.state, angle, False)
        self.model.realizePosition(self.state)

    def lengths(self) -> FloatArray:
        """Return the lengths of the paths, shape (K,) [m]."""
        return np.array([path.getLength(self.state) for path in self._paths])

    def muscle_paths(self) -> list[list[tuple[str, FloatArray]]]:
        """Return the points of each muscle's path, each with its body and its position in the ground frame [m].

        The ends of the parts that wrap around a bone are points too; body "" is the ground.
        """
        paths = []
        for path in self._paths:
            of = members(path.getCurrentPath(self.state))
            names = [point.getParentFrame().findBaseFrame().getName() for point in of]
            positions = [np.array(point.getLocationInGround(self.state).to_numpy()) for point in of]
            bodies = [name if name in self._bodies else "" for name in names]
            paths.append(list(zip(bodies, positions, strict=True)))
        return paths

    def frame(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return rotation of shape (3, 3) and origin [m] of a body in the ground."""
        transform = self._bodies[body][1].getTransformInGround(self.state)
        rotation = transform.R()
        R = np.reshape([rotation.get(i, j) for i in range(3) for j in range(3)], (3, 3))
        return R, transform.p().to_numpy()

    def centres(self, joints: Sequence[str]) -> list[FloatArray]:
        """Return the positions of joints in the ground, each of shape (3,) [m]."""
        of = [self.model.getJointSet().get(name).getParentFrame() for name in joints]
        return [frame.getPositionInGround(self.state).to_numpy() for frame in of]

    def lines(self) -> "ForceLines":
        """Return the forces that the muscles exert on the bodies at the current coordinates, per muscle force."""
        muscle, body, forces = [], [], []
        for k, path in enumerate(self._paths):
            directions = opensim.ArrayPointForceDirection()
            path.getPointForceDirections(self.state, directions)
            for direction in members(directions):
                name = direction.frame().findBaseFrame().getName()
                muscle.append(k)
                body.append(self._bodies[name][0] if name in self._bodies else -1)
                forces.append(direction.direction().to_numpy())
        return ForceLines(len(self._paths), np.array(muscle), np.array(body), np.array(forces))

    def numbers(self, bodies: Sequence[str]) -> IntArray:
        """Return the indices by which `ForceLines` refers to bodies."""
        return np.array([self._bodies[name][0] for name in bodies])


def members(group: Any) -> list[Any]:
    """Return the members of an OpenSim set or array as a list."""
    return [group.get(i) for i in range(group.getSize())]


@dataclass(frozen=True)
class ForceLines:
    """Forces of muscles on the bodies of a model, per muscle force.

    Attributes:
        muscles: number of muscles.
        muscle, body: index of muscle and body of each force, shape (n,).
        force: force per muscle force, in axes of the ground, shape (n, 3) [1].
    """

    muscles: int
    muscle: IntArray
    body: IntArray
    force: FloatArray

    def pull(self, distal: IntArray) -> FloatArray:
        """Sum the forces of each muscle on the bodies `distal`, in axes of the ground, shape (muscles, 3) [1]."""
        on = np.isin(self.body, distal)
        summed = np.zeros((self.muscles, 3))
        np.add.at(summed, self.muscle[on], self.force[on])
        return summed
