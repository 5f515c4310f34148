"""What the control cycle on OpenSim costs beside OpenSim's bare step, as ratios measured in one run.

    python tests/benchmarks/opensim_cost.py

Bare steps are those of the reduced model in a process of their own (bare_opensim.py), in turn with the cycles:
OpenSim's third-order integrator by its Manager, and one semi-implicit step of OpenSim's accelerations. Each round times
a block of each, in CPU time of the thread; medians over all rounds are reported, as in cycle_cost.py. "Loaded first"
are bare steps with the libraries bound as the plant binds them (urdf_to_osim.loading).
"""

import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cycle_cost import FRANKA, GENERIC, WholeCycle, arm_urdf

import opensim_ros_control  # noqa: F401  (before anything that loads OpenSim)
import panda_description

BLOCK = 100
"""Cycles per timed block."""
REDUCED: dict[str, Any] = {"rotor_inertia": 0.0}
SEMI_IMPLICIT: dict[str, Any] = {**REDUCED, "integrator": "semi_implicit"}
FULL: dict[str, Any] = {
    "rotor_inertia": 0.1,
    "friction": "identified",
    "friction_parameters": panda_description.friction_parameters(),
}
CASES: dict[str, tuple[dict[str, Any], str, str]] = {
    "reduced, accurate": (REDUCED, "third_order", GENERIC),
    "reduced, semi-implicit": (SEMI_IMPLICIT, "semi_implicit", GENERIC),
    "full, accurate": (FULL, "third_order", GENERIC),
    "full, accurate, control box": (FULL, "third_order", FRANKA),
}
"""Plant, bare step and robot of each comparison."""


@dataclass(frozen=True)
class Cost:
    """Cost of a whole cycle.

    Attributes:
        bare_us: one bare step of OpenSim as it is installed [us of CPU time].
        loaded_first_us: one bare step with the libraries loaded as the plant loads them, likewise.
        cycle_us: one whole cycle, likewise.
        ratio: of the cycle to a bare step as installed, median of the rounds [1].
        ratio_loaded_first: of the cycle to a bare step with the same libraries loaded, likewise [1].
    """

    bare_us: float
    loaded_first_us: float
    cycle_us: float
    ratio: float
    ratio_loaded_first: float

    @property
    def real_time_factor(self) -> float:
        """Robot time per CPU time at 1 ms a cycle [1]."""
        return 1000.0 / self.cycle_us


class BareProcess:
    """Bare steps in a process of their own; a context.

    Args:
        kind: see bare_opensim.py.
        loaded_first: with the libraries loaded as the plant loads them.
    """

    def __init__(self, kind: str, loaded_first: bool = False) -> None:
        command = [
            sys.executable,
            str(Path(__file__).parent / "bare_opensim.py"),
            kind,
            *(["loaded_first"] if loaded_first else []),
        ]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __enter__(self) -> "BareProcess":
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(timeout=10.0)

    def run(self, n: int) -> tuple[float, list[float]]:
        """(mean cost of n steps [s of CPU time], positions that they led to [rad])."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(n, file=self._process.stdin, flush=True)
        for line in self._process.stdout:
            if line[0].isdigit():
                spent, *q = map(float, line.split())
                return spent, q
        raise AssertionError(f"the bare process ended with {self._process.wait()}")


def measure(name: str, rounds: int = 40) -> Cost:
    """Compare a whole cycle on OpenSim with a bare step.

    Args:
        name: one of CASES.
        rounds: blocks of each.
    """
    plant, kind, robot_hw = CASES[name]
    whole = WholeCycle(arm_urdf(), plant, robot_hw, "opensim_ros_control/OpenSimPlant")
    with BareProcess(kind) as bare, BareProcess(kind, loaded_first=True) as loaded_first:
        blocks = []
        for _ in range(rounds + 1):
            costs = bare.run(BLOCK)[0], loaded_first.run(BLOCK)[0]
            begin = time.thread_time()
            whole.run(BLOCK)
            blocks.append((*costs, (time.thread_time() - begin) / BLOCK))
    whole.hw.shutdown()
    bare_us, first_us, cycle_us = (1e6 * statistics.median(column) for column in zip(*blocks[1:], strict=True))
    ratios = (statistics.median(block[2] / block[reference] for block in blocks[1:]) for reference in (0, 1))
    return Cost(bare_us, first_us, cycle_us, *ratios)


def main() -> None:
    """Print the table."""
    print("                                bare step [us]    whole cycle     ratio to bare [1]      real-time")
    print("form                     installed  loaded first           us  installed  loaded first      factor")
    for name in CASES:
        cost = measure(name)
        steps = f"{cost.bare_us:5.1f} {cost.loaded_first_us:13.1f} {cost.cycle_us:12.1f}"
        print(f"{name:28s} {steps} {cost.ratio:10.2f} {cost.ratio_loaded_first:13.2f} {cost.real_time_factor:11.1f}")


if __name__ == "__main__":
    main()
