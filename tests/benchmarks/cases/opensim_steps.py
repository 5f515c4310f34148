"""Benchmark cases of bare OpenSim steps, before each of which the efforts of all joints are written."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from cases import Block
from cases.arms import SETPOINT, arm_urdf, timed

EFFORTS = [0.5, -20.0, 0.2, 15.0, 0.1, 2.0, 0.05]
"""Joint efforts that approximately hold the arm [N m]."""
BLOCK = 100


class Bare:
    """Reduced model (arm without rotor inertia and friction) with constant efforts, for bare steps.

    Args:
        loaded_first: load OpenSim's libraries like the plant, else by OpenSim's default.
    """

    def __init__(self, loaded_first: bool) -> None:
        if loaded_first:
            import opensim_ros_control  # noqa: F401  (loads Simbody before OpenSim's modules)
        import opensim

        from urdf_to_osim import Options, convert

        self._opensim: Any = opensim
        opensim.Logger.setLevelString("Error")
        self._conversion = convert(arm_urdf(), Options(stops=False, friction="none", meshes=False, damping=False))
        self.model = self._conversion.model
        self.state = opensim.State(self.model.initSystem())
        self.state.setQ(opensim.Vector.createFromMat(np.array(SETPOINT)))
        found = self.model.getActuators()
        self.actuators = [opensim.CoordinateActuator.safeDownCast(found.get(i)) for i in range(found.getSize())]
        for actuator in self.actuators:
            actuator.overrideActuation(self.state, True)

    def write_efforts(self) -> None:
        """Write the efforts to the controls of the actuators in the present state."""
        for actuator, effort in zip(self.actuators, EFFORTS, strict=True):
            actuator.setOverrideActuation(self.state, effort)


@contextmanager
def third_order(loaded_first: bool = True) -> Iterator[Block]:
    """Measure steps of OpenSim's Manager with RungeKutta3."""
    bare = Bare(loaded_first)
    manager = bare._opensim.Manager(bare.model)
    manager.setIntegratorMethod(bare._opensim.Manager.IntegratorMethod_RungeKutta3)
    manager.setIntegratorFixedStepSize(1e-3)
    manager.setWriteToStorage(False)
    manager.setPerformAnalyses(False)
    manager.initialize(bare.state)
    bare.state, steps = manager.getState(), 0

    def run(n: int) -> None:
        nonlocal steps
        for _ in range(n):
            bare.write_efforts()
            steps += 1
            bare.state = manager.integrate(1e-3 * steps)

    yield timed(run, BLOCK)


@contextmanager
def semi_implicit() -> Iterator[Block]:
    """Measure semi-implicit Euler steps with OpenSim's accelerations."""
    bare = Bare(loaded_first=True)
    state, to_vector = bare.state, bare._opensim.Vector.createFromMat
    q, u = state.getQ().to_numpy(), state.getU().to_numpy()

    def run(n: int) -> None:
        nonlocal q, u
        for _ in range(n):
            bare.write_efforts()
            state.setQ(to_vector(q))
            state.setU(to_vector(u))
            bare.model.realizeAcceleration(state)
            u = u + 1e-3 * state.getUDot().to_numpy()
            q = q + 1e-3 * u

    yield timed(run, BLOCK)
