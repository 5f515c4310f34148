"""Measure the share of free motions that a collision reflex ends, by collision thresholds and `realism`.

    python tests/benchmarks/false_reflexes.py [motions]

The emulated arm of `hric control_box` moves between poses around the ready pose with its internal joint impedance and
without collision shapes, along fifth-order polynomials at half of its limits of velocity and acceleration. Its
thresholds are set too high to be reached. For thresholds of s times the default (config/control_box.yaml), a motion
would end in joint_reflex or cartesian_reflex if its largest external torque or force exceeds s times the default. The
second table, by which the preset `measured` was tuned, compares the estimated external torque in free motion with the
residual of a real arm's model.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome
from franka_sim.fci.app import ControlBoxCommand
from franka_sim.fci.arm_device import ArmDevice
from franka_sim.fci.robots import ROBOTS
from franka_sim.fci.world_building import make_arm
from franka_sim.settings import Q_START
from hric_core.errors import HricError

FloatArray = npt.NDArray[np.float64]
NO_NOISE = {"q_noise": 0.0, "dq_noise": 0.0, "tau_J_noise": 0.0, "wrench_noise": [0.0] * 6}
SAME_BODY = {"mass_error": 0.0, "com_error": 0.0}
KNOWN_FRICTION = {"friction": "none", "friction_known": 1.0}
FORMS: Mapping[str, Mapping[str, Any]] = {
    "ideal": {"preset": "ideal"},
    "noise alone": {"preset": "measured", **SAME_BODY, **KNOWN_FRICTION},
    "body alone": {"preset": "measured", **NO_NOISE, **KNOWN_FRICTION},
    "friction alone": {"preset": "measured", **NO_NOISE, **SAME_BODY},
    "measured": {"preset": "measured"},
}
"""Values of --realism by the names in the tables."""
SCALES = (1.0, 0.3, 0.2, 0.15, 0.12, 0.1, 0.07, 0.05, 0.02, 0.01, 0.005, 0.002)
"""Thresholds as multiples of the default [1]."""
REAL = (0.07, 0.58, 1.7)
"""Residual of a real arm's model with identified friction: smallest and largest of the joints, and sum [N m RMS]."""
REACH = 0.5
"""Maximum distance of poses from the ready pose, per joint [rad]: far from singularities, stops and self-collision."""
SHARE = 0.5
"""Share of the limits of velocity and acceleration that a motion uses [1]."""
OUT_OF_REACH = 1e6
DT = 1e-3
ZEROS = [0.0] * 7


@dataclass
class Felt:
    """Estimated external torques and forces of an arm in free motions.

    Attributes:
        peaks: per motion, the largest external torque or force as a multiple of its threshold [1].
        squares: sum of the squared external torques, shape (7,) [N^2 m^2].
        cycles: number of cycles in this sum.
    """

    peaks: list[float] = field(default_factory=list)
    squares: FloatArray = field(default_factory=lambda: np.zeros(7))
    cycles: int = 0

    def rate(self, scale: float) -> float:
        """Return the share of motions that thresholds of `scale` times the default would have ended [1]."""
        return sum(peak > scale for peak in self.peaks) / len(self.peaks)

    @property
    def rms(self) -> FloatArray:
        """Return the external torque during motion, shape (7,) [N m RMS]."""
        return np.sqrt(self.squares / self.cycles)


def emulated_arm(realism: Mapping[str, Any] | str, seed: int = 0) -> ArmDevice:
    """Return the emulated arm of `hric control_box`, without collision shapes.

    Args:
        realism: value of --realism.
        seed: seed of the noise.
    """
    options = ControlBoxCommand().parser().parse_args(["--no-collision", "--seed", str(seed)])
    options.realism = realism
    return make_arm(options, ROBOTS["panda"])


def targets(motions: int) -> FloatArray:
    """Return the target poses, the same in each call, shape (motions, 7) [rad]."""
    return np.array(Q_START) + np.random.default_rng(0).uniform(-REACH, REACH, (motions, 7))


def path(arm: ArmDevice, goal: Sequence[float]) -> FloatArray:
    """Return positions from the present pose to a goal, s = 10 x^3 - 15 x^4 + 6 x^5, shape (cycles, 7) [rad]."""
    start, limits = np.array(arm.state.q_d), arm.box.config.limits
    way = np.abs(goal - start)
    # The polynomial's largest velocity is 1.875 and its largest acceleration 5.774 times those of a straight line in
    # the same time.
    fastest = np.max(1.875 * way / (SHARE * np.array(limits.velocity)))
    duration = max(fastest, np.max(np.sqrt(5.774 * way / (SHARE * np.array(limits.acceleration)))))
    x = np.arange(1, int(duration / DT) + 2)[:, None] / (int(duration / DT) + 1)
    return np.asarray(start + (goal - start) * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5))


def move(arm: ArmDevice, goal: Sequence[float], felt: Felt | None = None) -> frozenset[str]:
    """Execute a motion to `goal`, and return the errors that ended it, if any.

    Args:
        arm: arm at rest.
        goal: target joint positions, 7 floats [rad].
        felt: records external torques and forces.

    Raises:
        HricError: the motion does not start.
    """
    outcome = arm.move(MoveRequest(ControllerMode.JOINT_IMPEDANCE, GeneratorMode.JOINT_POSITION))
    if outcome is not RequestOutcome.STARTED:
        raise HricError(f"the motion is refused: {outcome.value}")
    default, state, worst = arm.box.config.collision_behavior, arm.state, 0.0
    thresholds = (*default.upper_torque_nominal, *default.upper_force_nominal)
    rows = path(arm, goal).tolist()
    for i, q in enumerate(rows):
        arm.cycle(MotionCommand(q, ZEROS, [0.0] * 16, [0.0] * 6, None, ZEROS, i == len(rows) - 1))
        if state.robot_mode is RobotMode.REFLEX:
            break
        if felt is not None:
            estimates = (*state.tau_ext_hat_filtered, *state.K_F_ext_hat_K)
            worst = max(worst, *(abs(x) / limit for x, limit in zip(estimates, thresholds, strict=True)))
            felt.squares += np.square(state.tau_ext_hat_filtered)
    if felt is not None:
        felt.peaks.append(worst)
        felt.cycles += len(rows)
    return state.current_errors


def measure(realism: Mapping[str, Any] | str, motions: int, seed: int = 0) -> Felt:
    """Execute a number of motions, and return the estimated external torques and forces.

    Args:
        realism: value of --realism.
        motions: number of motions.
        seed: seed of the noise.

    Raises:
        HricError: a motion ended for another reason.
    """
    arm, felt = emulated_arm(realism, seed), Felt()
    arm.set_collision_behavior(*[[OUT_OF_REACH] * 7] * 4, *[[OUT_OF_REACH] * 6] * 4)
    try:
        for goal in targets(motions):
            if errors := move(arm, goal, felt):
                raise HricError(f"a motion was ended by {', '.join(errors)}")
    finally:
        arm.close()
    return felt


def main(words: Sequence[str]) -> int:
    """Measure and print both tables."""
    motions = int(words[0]) if words else 60
    found = {name: measure(realism, motions) for name, realism in FORMS.items()}
    print(f"share of {motions} motions without contact that end in joint_reflex or cartesian_reflex\n")
    print("| thresholds, times the default |" + "".join(f" {name} |" for name in found))
    print("|---|" + "---|" * len(found))
    for scale in SCALES:
        print(f"| {scale:g} |" + "".join(f" {100.0 * felt.rate(scale):.0f} % |" for felt in found.values()))
    print("\nestimated external torque of these motions, N m RMS\n")
    print("| |" + "".join(f" joint {i} |" for i in range(1, 8)) + " sum |\n|---|" + "---|" * 8)
    for name, felt in found.items():
        print(f"| {name} |" + "".join(f" {x:.3f} |" for x in felt.rms) + f" {felt.rms.sum():.2f} |")
    print(f"\na real arm's model, with identified friction: {REAL[0]} to {REAL[1]} per joint, {REAL[2]} in sum")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
