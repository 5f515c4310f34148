"""Forward simulation of an OpenSim model from its default pose, to check that it can be integrated, and how fast."""

import time
from dataclasses import dataclass

import numpy as np
import opensim

from hric_core.errors import DescriptionError
from urdf_to_osim import transforms

PIECE = 0.01
"""Simulated time between two checks of the processor time [s]."""
ENOUGH = 0.05
"""Minimum processor time of a measurement [s]; a fast simulation is repeated, as the clock may have steps of 1 ms."""
LIMIT = 2.0
"""Processor time after which a slow simulation is stopped [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class Forward:
    """Result of a forward simulation without controls, from the default pose at rest.

    OpenSim's default integrator and accuracy are used.

    Attributes:
        simulated: simulated time of one run [s].
        processor: processor time of all runs [s].
        runs: number of runs.
    """

    simulated: float
    processor: float
    runs: int

    @property
    def real_time_factor(self) -> float:
        """Simulated time divided by processor time [1]."""
        return self.runs * self.simulated / self.processor

    def summary(self) -> str:
        """Return the result in one line."""
        factor = f"real-time factor {self.real_time_factor:.2g} by processor time"
        return (
            f"forward {self.simulated:g} s: {factor} ({self.runs} runs, {self.processor:.3f} s of processor "
            "time in all)"
        )


def run_forward(model: opensim.Model, start: opensim.State, seconds: float) -> Forward:
    """Simulate a model from a state for some seconds; the state object is not changed.

    Raises:
        DescriptionError: OpenSim cannot integrate the model, or a result is not finite.
    """
    runs, simulated, began = 0, seconds, time.process_time()
    while (spent := time.process_time() - began) < ENOUGH:
        simulated = _run(model, opensim.State(start), seconds)
        runs += 1
    return Forward(simulated, spent, runs)


def _run(model: opensim.Model, state: opensim.State, seconds: float) -> float:
    """Return the simulated time that one run reached within the limit [s]."""
    manager = opensim.Manager(model)
    manager.setWriteToStorage(False)
    manager.setPerformAnalyses(False)
    first, began = state.getTime(), time.process_time()
    try:
        with transforms.quiet():
            manager.initialize(state)
            for end in np.arange(1, round(seconds / PIECE) + 1) * PIECE:
                state = manager.integrate(first + float(end))
                if not np.isfinite(state.getY().to_numpy()).all():
                    raise DescriptionError(
                        f"in a forward simulation a coordinate is not finite after {end:.2f} s; check masses, inertias "
                        "and stops"
                    )
                if time.process_time() - began > LIMIT:
                    break
    except RuntimeError as error:
        raise DescriptionError(f"OpenSim cannot integrate the model: {transforms.message_of(error)}") from error
    return float(state.getTime() - first)
