"""Simulation of published handovers between two people, with the robot as the giver."""

from hric_run.definition import experiment
from hric_run.simulation import Simulation
from hric_sweep.observed import Observed
from hric_sweep.outputs import SweepOutput
from hric_sweep.reproduction.definition import DataSet

OUTPUTS = {
    "overlap": SweepOutput(path="human.handovers.*.overlap", unit="s"),
    "force": SweepOutput(path="human.handovers.*.force_max", unit="N"),
}
"""Time for which giver and taker hold the object, and largest force of the taker's hand meanwhile."""


def handover(data: DataSet) -> dict[str, float]:
    """Return overlap [s] and largest force [N] of the experiment `handover`."""
    with Simulation(experiment.load("handover", ["simulator:=mujoco"])) as simulation:
        observed = Observed(simulation, {"human"})
        simulation.run()
        values = observed.values()
    return {name: output.measured(values) for name, output in OUTPUTS.items()}
