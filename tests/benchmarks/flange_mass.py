"""Masses with which the flange of the arm hits, over random poses and directions: by the project and by pinocchio.

    python3 tests/benchmarks/flange_mass.py [--inertials fr3] [--poses 3000]

Joint positions are uniform within the limits of the joints, directions uniform on the sphere; the arm has no hand.
"""

import argparse
from collections.abc import Sequence

import numpy as np
import pinocchio

import panda_description
from hric_assessment.contact.mass import Mechanism, moving_masses
from hric_core import urdf
from hric_core.geometry import FloatArray

JOINTS = tuple(f"panda_joint{i}" for i in range(1, 8))
FLANGE = "panda_link8"
ROTORS = {"no rotors": [0.0] * 7, "0.1 kg m^2 each": [0.1] * 7, "published rotors": panda_description.rotor_inertia()}
LOCKED = "locked joints"


class FlangeMasses:
    """Masses of the flange in random poses, from two libraries.

    Args:
        inertials: set of inertial parameters.
        count: number of poses.
        seed: seed of poses and directions.
    """

    def __init__(self, inertials: str = "barycentric", count: int = 3000, seed: int = 0) -> None:
        description = panda_description.load(hand=False, inertials=inertials, meshes=False, collision=False)
        self.tree, random = urdf.read(description), np.random.default_rng(seed)
        self._model = pinocchio.buildModelFromXML(description)
        limits = panda_description.joint_limits().values()
        self._q = random.uniform([one.lower for one in limits], [one.upper for one in limits], (count, 7))
        n = random.normal(size=(count, 3))
        self._n = n / np.linalg.norm(n, axis=1, keepdims=True)

    def own(self) -> dict[str, FloatArray]:
        """Return the masses by the project's code, shape (count,) each [kg], by name of the row."""
        p = [self.tree.poses(dict(zip(JOINTS, q, strict=True)))[FLANGE][:3, 3].tolist() for q in self._q]
        arms = {name: Mechanism(self.tree, JOINTS, rotors) for name, rotors in ROTORS.items()}
        rows = list(zip(self._q, p, self._n, strict=True))
        masses = {name: [arm.reflected_mass(q, FLANGE, p, n) for q, p, n in rows] for name, arm in arms.items()}
        masses[LOCKED] = [arms["no rotors"].locked_mass(q, p, n) for q, p, n in rows]
        return {name: np.array(values) for name, values in masses.items()}

    def library(self) -> dict[str, FloatArray]:
        """Return the masses by pinocchio, shape (count,) each [kg]."""
        masses: dict[str, list[float]] = {name: [] for name in (*ROTORS, LOCKED)}
        for q, n in zip(self._q, self._n, strict=True):
            for name, mass in self._by_library(q, n).items():
                masses[name].append(mass)
        return {name: np.array(values) for name, values in masses.items()}

    def _by_library(self, q: FloatArray, n: FloatArray) -> dict[str, float]:
        model, data = self._model, self._model.createData()
        frame = model.getFrameId(FLANGE)
        row = n @ pinocchio.computeFrameJacobian(model, data, q, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:3]
        M = np.triu(pinocchio.crba(model, data, q))
        M += np.triu(M, 1).T
        masses = {name: 1.0 / (row @ np.linalg.solve(M + np.diag(B), row)) for name, B in ROTORS.items()}
        pinocchio.ccrba(model, data, q, np.zeros(7))
        pinocchio.framesForwardKinematics(model, data, q)
        body, lever = data.Ig, np.cross(data.oMf[frame].translation - data.com[0], n)
        masses[LOCKED] = 1.0 / (1.0 / body.mass + lever @ np.linalg.solve(body.inertia, lever))
        return masses


def main(words: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inertials", choices=("barycentric", "fr3"), default="barycentric")
    parser.add_argument("--poses", type=int, default=3000)
    arguments = parser.parse_args(words)
    flange = FlangeMasses(arguments.inertials, arguments.poses)
    half, other = moving_masses(flange.tree, JOINTS)[0] / 2.0, flange.library()
    print(f"{'':18} median   95 %   above M/2 = {half:.2f} kg   largest difference from pinocchio")
    for name, mass in flange.own().items():
        difference = float(np.abs(mass / other[name] - 1.0).max())
        quantiles = f"{np.median(mass):6.2f} {np.percentile(mass, 95):6.2f} kg"
        print(f"{name:18} {quantiles}  {100 * np.mean(mass > half):5.0f} %   {difference:30.1e}")


if __name__ == "__main__":
    main()
