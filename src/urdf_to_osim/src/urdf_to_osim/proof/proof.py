"""Proof of a conversion: comparison of the written file with pinocchio and with equations at random states."""

import math
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf import ONE_COORDINATE, Joint
from urdf_to_osim.converter import Conversion, convert
from urdf_to_osim.options import Options
from urdf_to_osim.proof import closed_form
from urdf_to_osim.proof.forward import Forward, run_forward
from urdf_to_osim.proof.oracle import Oracle
from urdf_to_osim.reading import Reading

TOLERANCE = 1e-9
"""Maximum error in SI units, relative for values above 1: 1000 times the rounding (project default, unconfirmed)."""
LIGHT = "mass matrix / inertia"
"""Name of the error of a mass matrix element relative to its joints' inertias, which shows errors in light robots."""
LIGHT_TOLERANCE = 1e-6
LIMITS = {LIGHT: LIGHT_TOLERANCE}
UNITS = {
    "frames": "m, 1",
    "couplers": "rad, m, 1/s",
    "mass matrix": "kg m^2, kg",
    LIGHT: "1",
    "effort limits": "N m, N",
}


@dataclass
class Proof:
    """Result of a verification: maximum errors over random states.

    Attributes:
        errors: maximum error by compared quantity; only quantities that the robot has.
        states: number of random states.
        seconds: duration of the verification, without the forward simulation [s].
        repaired: maximum change by the repair of inertias, relative to the maximum value, by quantity; empty without
            a repair.
        forward: result of the forward simulation; None: it was not requested.
    """

    states: int
    errors: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    repaired: dict[str, float] = field(default_factory=dict)
    forward: Forward | None = None

    @property
    def failed(self) -> list[str]:
        """Quantities whose error is NaN or above its tolerance."""
        return [name for name, error in self.errors.items() if not error <= LIMITS.get(name, TOLERANCE)]

    @property
    def passed(self) -> bool:
        """True if all errors are within their tolerances."""
        return bool(self.errors) and not self.failed

    def compare(self, name: str, actual: FloatArray, expected: FloatArray) -> None:
        """Compare a quantity with its expected value, and keep the maximum error.

        The error is relative to the maximum expected value if that is above 1, else absolute.
        """
        scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
        self._add(name, float(np.max(np.abs(actual - expected), initial=0.0)) / scale)

    def compare_mass(self, actual: FloatArray, expected: FloatArray) -> None:
        """Compare a mass matrix with the expected one, and keep the maximum errors."""
        self.compare("mass matrix", actual, expected)
        scale = np.sqrt(np.diag(expected))
        self._add(LIGHT, float(np.max(np.abs(actual - expected) / np.outer(scale, scale), initial=0.0)))

    def _add(self, name: str, error: float) -> None:
        known = self.errors.get(name, 0.0)
        self.errors[name] = error if math.isnan(error) or error > known else known

    def table(self) -> str:
        """Return a text table of the errors, with units and tolerances."""
        lines = [f"{'compared':<24}{'unit':<14}{'largest error':>14}{'tolerance':>12}"]
        for name, error in self.errors.items():
            verdict = "" if name not in self.failed else "  FAILED"
            lines.append(
                f"{name:<24}{UNITS.get(name, 'N m, N'):<14}{error:>14.1e}{LIMITS.get(name, TOLERANCE):>12.0e}{verdict}"
            )
        return "\n".join(lines)


def prove(
    path: Path | str,
    urdf_xml: str,
    options: Options | None = None,
    states: int = 100,
    seed: int = 0,
    *,
    forward: float = 0.0,
    conversion: Conversion | None = None,
) -> Proof:
    """Verify a written model by comparison with the description from which it was converted.

    Args:
        path: .osim file.
        urdf_xml: description, as URDF.
        options: options of the conversion.
        states: number of random states.
        seed: seed of the random numbers.
        forward: simulated time of a forward simulation after the comparisons [s]; 0: none.
        conversion: result of the conversion, if available; otherwise the description is converted again.

    Returns:
        The errors; `passed` is True if they are within their tolerances.

    Raises:
        DescriptionError: OpenSim or pinocchio cannot use the model, a joint moves no inertia, or the forward
            simulation fails.
    """
    started = time.perf_counter()
    options = options or Options()
    prover = _Prover(conversion or convert(urdf_xml, options), urdf_xml, Path(path), options)
    proof = prover.run(states, seed)
    proof.repaired = prover.repaired(states, seed)
    proof.seconds = time.perf_counter() - started
    if forward > 0.0 and prover.size:
        proof.forward = run_forward(prover.reading.model, prover.reading.start, forward)
    return proof


class _Prover:
    """Comparisons of one .osim file with its description."""

    def __init__(self, conversion: Conversion, urdf_xml: str, path: Path, options: Options) -> None:
        self.options, self.plan, self.urdf_xml = options, conversion.plan, urdf_xml
        self.names, self.friction_velocities = conversion.plan.joints, conversion.plan.friction_velocities
        self.oracle = Oracle(conversion.plan, urdf_xml, options.gravity, options.up)
        self.joints = self.oracle.joints
        paths = [name for joint in self.joints for name in conversion.joints[joint.name].paths]
        self.reading = Reading(path, paths, {name: frame.path for name, frame in conversion.frames.items()})
        # Joints with one coordinate, as pinocchio reads them, and its index.
        starts = np.cumsum([0, *[len(conversion.joints[joint.name].coordinates) for joint in self.joints]])
        self.single = {
            joint.name: (self.oracle.described(joint), int(start))
            for joint, start in zip(self.joints, starts, strict=False)
            if joint.type in ONE_COORDINATE
        }
        self.size = int(starts[-1])

    def run(self, count: int, seed: int) -> Proof:
        proof, random = Proof(count), np.random.default_rng(seed)
        for _ in range(count):
            self._rigid(proof, random)
            if self.single:
                self._forces(proof, random)
        self._compare_limits(proof)
        return proof

    def repaired(self, count: int, seed: int) -> dict[str, float]:
        """Return the maximum changes of mass matrix and inverse dynamics that the repair of inertias causes.

        Over random states, relative to the maximum values; empty without a repair.
        """
        if not self.size or not self.plan.repaired:
            return {}
        before = Oracle(
            replace(self.plan, robot=self.plan.described), self.urdf_xml, self.options.gravity, self.options.up
        )
        changes, random = {"mass matrix": 0.0, "inverse dynamics": 0.0}, np.random.default_rng(seed)
        for _ in range(count):
            x = self._anywhere(random)
            xd, xdd = random.normal(size=(2, self.size))
            pairs = [(oracle.mass(x), oracle.inverse_dynamics(x, xd, xdd)) for oracle in (before, self.oracle)]
            for name, old, new in zip(changes, *pairs, strict=True):
                change = np.max(np.abs(new - old)) / max(np.max(np.abs(old)), np.max(np.abs(new)))
                changes[name] = max(changes[name], float(change))
        return changes

    def _anywhere(self, random: np.random.Generator) -> FloatArray:
        return np.array([value for joint in self.joints for value in closed_form.coordinates(joint, random)])

    def _rigid(self, proof: Proof, random: np.random.Generator) -> None:
        x = self._anywhere(random)
        xd, xdd = random.normal(size=(2, self.size))
        self.reading.move(x, np.zeros(self.size))
        expected = self.oracle.frames(x)
        frames = self.reading.frames()
        proof.compare("frames", np.array([frames[name] for name in expected]), np.array(list(expected.values())))
        if not self.size:
            return
        mass = self.oracle.mass(x)
        self._check_movable(mass)
        proof.compare_mass(self.reading.mass(), mass)
        proof.compare("gravity", self.reading.inverse_dynamics(np.zeros(self.size)), self.oracle.gravity(x))
        self.reading.move(x, xd)
        proof.compare("inverse dynamics", self.reading.inverse_dynamics(xdd), self.oracle.inverse_dynamics(x, xd, xdd))
        if not np.isfinite(self.reading.accelerations()).all():
            raise DescriptionError(
                "OpenSim finds no finite accelerations for this robot; check the masses and inertias of its links"
            )

    def _check_movable(self, mass: FloatArray) -> None:
        scale = np.sqrt(np.abs(np.diag(mass)))
        owners = [joint.name for joint in self.joints for _ in range({"planar": 3, "floating": 6}.get(joint.type, 1))]
        if not scale.all():
            raise DescriptionError(
                f"joint {owners[int(np.argmin(scale))]} moves no inertia; give the links that it moves an <inertial>"
            )
        values, vectors = np.linalg.eigh(mass / np.outer(scale, scale))
        if values[0] < 1e-13:
            guilty = sorted({owners[i] for i in np.flatnonzero(np.abs(vectors[:, 0]) > 0.1)})
            raise DescriptionError(
                f"joints {', '.join(guilty)} can move together without moving any inertia; give the links between "
                "them an <inertial>"
            )

    def _forces(self, proof: Proof, random: np.random.Generator) -> None:
        x = self._anywhere(random)
        xd = closed_form.speeds(self.size, random)
        for joint, index in self.single.values():
            x[index] = closed_form.around_stops(joint, random, self.options)
        self.reading.move(x, xd)
        none = self.reading.inverse_dynamics(np.zeros(self.size))
        for kind in ("damping", "friction", "stop"):
            self._compare_force(proof, kind, none, x, xd)
        self._compare_actuators(proof, none, random)
        self._compare_couplers(proof, x, xd)

    def _law(self, kind: str, joint: Joint, q: float, dq: float) -> float:
        if kind == "damping":
            return -joint.damping * dq if self.options.damping else 0.0
        if kind == "friction":
            velocity = self.friction_velocities.get(joint.name, math.inf)
            return closed_form.friction(joint, dq, self.options, velocity) if self.options.friction != "none" else 0.0
        return closed_form.stop(joint, q, dq, self.options) if self.options.stops else 0.0

    def _compare_force(self, proof: Proof, kind: str, none: FloatArray, x: FloatArray, xd: FloatArray) -> None:
        names = [name for name in self.reading.forces if name.endswith(f"_{kind}")]
        expected = np.zeros(self.size)
        for joint, index in self.single.values():
            expected[index] = self._law(kind, joint, float(x[index]), float(xd[index]))
        if not names and not expected.any():
            return
        with self.reading.acting(names):
            efforts = none - self.reading.inverse_dynamics(np.zeros(self.size))
        # A difference of efforts, so their rounding errors count.
        scale = max(1.0, float(np.max(np.abs(none))))
        proof.compare({"stop": "stops"}.get(kind, kind), efforts / scale, expected / scale)

    def _driven(self) -> dict[str, tuple[Joint, int]]:
        """Return (joint, index of its coordinate) of each actuator, by the actuator's name in the model."""
        if not self.options.actuators:
            return {}
        return {
            f"{self.names[name]}_actuator": (joint, index)
            for name, (joint, index) in self.single.items()
            if joint.mimic is None
        }

    def _compare_actuators(self, proof: Proof, none: FloatArray, random: np.random.Generator) -> None:
        driven = self._driven()
        if not driven:
            return
        values = {name: float(random.normal()) for name in driven}
        expected = np.zeros(self.size)
        for name, (_, index) in driven.items():
            expected[index] = values[name]
        with self.reading.acting(driven):
            self.reading.control(values)
            efforts = none - self.reading.inverse_dynamics(np.zeros(self.size))
        scale = max(1.0, float(np.max(np.abs(none))))
        proof.compare("actuators", efforts / scale, expected / scale)

    def _compare_limits(self, proof: Proof) -> None:
        driven = self._driven()
        if not driven:
            return
        limits = self.reading.control_limits()
        ends = np.array([[-joint.effort, joint.effort] for joint, _ in driven.values()])
        read = np.array([limits[name] for name in driven])
        bounded = np.isfinite(ends)
        unbounded = 0.0 if np.array_equal(read[~bounded], ends[~bounded]) else math.inf
        proof.compare("effort limits", np.append(read[bounded], unbounded), np.append(ends[bounded], 0.0))

    def _compare_couplers(self, proof: Proof, x: FloatArray, xd: FloatArray) -> None:
        off, off_speed = [], []
        for joint, index in self.single.values():
            if joint.mimic is not None:
                source = self.single[joint.mimic.joint][1]
                off.append(joint.mimic.multiplier * x[source] + joint.mimic.offset - x[index])
                off_speed.append(joint.mimic.multiplier * xd[source] - xd[index])
        if off:
            q_error, u_error = self.reading.coupler_errors()
            proof.compare("couplers", np.concatenate([q_error, u_error]), np.array([*off, *off_speed]))
