"""Bare steps of OpenSim as its package loads itself, in a process of its own: python bare_opensim.py
third_order|semi_implicit [loaded_first].

For each line with a number of steps on its input it answers with their mean cost [s of CPU time of the thread] and the
positions that they led to. A step is commanded: the efforts of all joints are written before it, as any robot's are.
With `loaded_first` OpenSim's libraries are loaded as the plant loads them.
"""

import sys
import time

import numpy as np

if "loaded_first" in sys.argv:
    import opensim_ros_control  # noqa: F401  (loads Simbody before OpenSim's modules)
import opensim
from cycle_cost import SETPOINT, arm_urdf

from urdf_to_osim import Options, convert

EFFORTS = [0.5, -20.0, 0.2, 15.0, 0.1, 2.0, 0.05]
"""Near what holds the arm [N m]."""


class Bare:
    """The reduced model (the arm, no rotor inertia, no friction), its efforts held, stepped and nothing else."""

    def __init__(self) -> None:
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
        """By the actuators' own channel, into the present state."""
        for actuator, effort in zip(self.actuators, EFFORTS, strict=True):
            actuator.setOverrideActuation(self.state, effort)


class ThirdOrder(Bare):
    """OpenSim's RungeKutta3 by its Manager."""

    def __init__(self) -> None:
        super().__init__()
        self._manager = manager = opensim.Manager(self.model)
        manager.setIntegratorMethod(opensim.Manager.IntegratorMethod_RungeKutta3)
        manager.setIntegratorFixedStepSize(1e-3)
        manager.setWriteToStorage(False)
        manager.setPerformAnalyses(False)
        manager.initialize(self.state)
        self.state, self._steps = manager.getState(), 0

    def run(self, n: int) -> None:
        """Step n times."""
        for _ in range(n):
            self.write_efforts()
            self._steps += 1
            self.state = self._manager.integrate(1e-3 * self._steps)


class SemiImplicit(Bare):
    """Euler's method on OpenSim's accelerations."""

    def __init__(self) -> None:
        super().__init__()
        self._q, self._u = self.state.getQ().to_numpy(), self.state.getU().to_numpy()

    def run(self, n: int) -> None:
        """Step n times."""
        state, to_vector, realize = self.state, opensim.Vector.createFromMat, self.model.realizeAcceleration
        for _ in range(n):
            self.write_efforts()
            state.setQ(to_vector(self._q))
            state.setU(to_vector(self._u))
            realize(state)
            self._u = self._u + 1e-3 * state.getUDot().to_numpy()
            self._q = self._q + 1e-3 * self._u


KINDS: dict[str, type[ThirdOrder] | type[SemiImplicit]] = {"third_order": ThirdOrder, "semi_implicit": SemiImplicit}


def main() -> None:
    """Answer until the input ends."""
    bare = KINDS[sys.argv[1]]()
    for line in sys.stdin:
        n, begin = int(line), time.thread_time()
        bare.run(n)
        spent = (time.thread_time() - begin) / n
        print(spent, *bare.state.getQ().to_numpy().tolist(), flush=True)


if __name__ == "__main__":
    main()
