"""A model in forward dynamics: whether OpenSim can integrate it from its default pose, and how fast."""

import time
from dataclasses import dataclass

import numpy as np
import opensim

from hric_control.errors import DescriptionError
from urdf_to_osim import transforms

PIECE = 0.01
"""Simulated time between two looks at the processor's clock [s]."""
ENOUGH = 0.05
"""Processor time that is measured: a quick run is repeated until then, since the clock may tick in milliseconds [s]."""
LIMIT = 2.0
"""Processor time after which a slow run is not carried on [s]: default chosen by this project, unconfirmed."""


@dataclass(frozen=True)
class Forward:
    """A forward run without controls, from the default pose at rest, with OpenSim's own integrator and accuracy.

    Attributes:
        simulated: time that was simulated [s].
        processor: processor time for it, repetitions included [s].
        runs: number of repetitions.
    """

    simulated: float
    processor: float
    runs: int

    @property
    def real_time_factor(self) -> float:
        """Simulated time per processor time."""
        return self.runs * self.simulated / self.processor

    def summary(self) -> str:
        """The result in one line."""
        factor = f"real-time factor {self.real_time_factor:.2g} by processor time"
        return (
            f"forward {self.simulated:g} s: {factor} ({self.runs} runs, {self.processor:.3f} s of processor "
            "time in all)"
        )

    told = summary
    """The former name, for one release."""


def run_forward(model: opensim.Model, start: opensim.State, seconds: float) -> Forward:
    """Integrate a model from a state, which is not changed.

    Raises:
        DescriptionError: OpenSim cannot integrate it, or what it finds is not finite.
    """
    runs, simulated, began = 0, seconds, time.process_time()
    while (spent := time.process_time() - began) < ENOUGH:
        simulated = _run(model, opensim.State(start), seconds)
        runs += 1
    return Forward(simulated, spent, runs)


def _run(model: opensim.Model, state: opensim.State, seconds: float) -> float:
    """One run; returns how far it came within the limit [s]."""
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
                        f"in forward dynamics a coordinate is not finite after {end:.2f} s; check masses, inertias "
                        "and stops"
                    )
                if time.process_time() - began > LIMIT:
                    break
    except RuntimeError as error:
        raise DescriptionError(f"OpenSim cannot integrate the model: {transforms.said(error)}") from error
    return float(state.getTime() - first)
