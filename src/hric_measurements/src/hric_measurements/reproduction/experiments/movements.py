"""Simulation of published reaching movements and handovers."""

import numpy as np

from hric_core.geometry import FloatArray
from hric_measurements.reproduction.definition import DataSet
from hric_measurements.reproduction.experiments.person import AVERAGE_MAN, control
from hric_measurements.reproduction.experiments.plant import CYCLE, ArmInPlant
from hric_run.definition import experiment
from hric_run.simulation import Simulation
from hric_sweep.observed import Observed
from hric_sweep.outputs import SweepOutput

MOVED = {"sh_flex": 60.0, "el_flex": 40.0}
"""Posture at the end of the movement, which begins in the resting posture [deg]."""
BEGIN, DURATION, AFTER = 0.5, 0.5, 0.5
"""Time at rest before the movement, duration of the desired movement, and time at rest after it [s]."""
THRESHOLD = 0.05
"""Share of the peak speed above which the hand counts as moving [1]."""
OUTPUTS = {
    "overlap": SweepOutput(path="human.handovers.*.overlap", unit="s"),
    "force": SweepOutput(path="human.handovers.*.force_max", unit="N"),
}
"""Outputs of a run: time for which giver and taker hold the object, and the taker's largest force in this time."""


def intermediate_speed(data: DataSet) -> dict[str, float]:
    """Return the time to peak speed as a share of the duration of a movement [1]."""
    speed = _speed()
    return {"peak_time": float(np.argmax(speed) / (len(speed) - 1))}


def profile(data: DataSet) -> dict[str, float]:
    """Return the ratio of the peak speed to the mean speed of a movement [1]."""
    speed = _speed()
    return {"peak_by_mean": float(speed.max() / speed.mean())}


def _speed() -> FloatArray:
    """Return the speed of a reaching hand in each cycle of its movement, shape (n,) [m/s]."""
    person = control(AVERAGE_MAN).person
    start = dict(zip(person.joints, person.rest, strict=True))
    goal = start | {f"right_{joint}": float(np.radians(angle)) for joint, angle in MOVED.items()}
    points = [{"time": BEGIN, **start}, {"time": BEGIN + DURATION, **goal}]
    with ArmInPlant(control(AVERAGE_MAN, points=points)) as arm:
        speed = np.linalg.norm(np.diff(arm.moved(BEGIN + DURATION + AFTER), axis=0), axis=1) / CYCLE
    moving = np.flatnonzero(speed > THRESHOLD * speed.max())
    return np.asarray(speed[moving[0] : moving[-1] + 1])


def handover(data: DataSet) -> dict[str, float]:
    """Return overlap [s] and largest force [N] of the experiment `handover`."""
    with Simulation(experiment.load("handover", ["simulator:=mujoco"])) as simulation:
        observed = Observed(simulation, {"human"})
        simulation.run()
        values = observed.values()
    return {name: output.measured(values) for name, output in OUTPUTS.items()}
