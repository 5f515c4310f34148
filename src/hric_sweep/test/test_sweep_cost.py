"""Cost of a run of a sweep, from building the simulation to the result, and gain by two processors. Prints figures of
docs/figures.md."""

import time
from pathlib import Path
from typing import Any

import pytest
import test_sweep as sweeps
import yaml

from hric_run.definition import experiment
from hric_sweep import definition, table, task
from hric_sweep.records import RunTask

RUNS, HANDOVERS = 1000, 200
ENOUGH = 7200.0
"""[s]"""
ENGINES = {
    "MuJoCo, implicitfast": ["simulator:=mujoco", "robot.plant.integrator:=semi_implicit"],
    "MuJoCo, Runge-Kutta": ["simulator:=mujoco", "robot.plant.integrator:=accurate"],
    "PyBullet": ["simulator:=pybullet"],
}


@pytest.mark.slow  # a thousand runs of 5 s of robot time on each engine
@pytest.mark.parametrize("engine", ENGINES)
def test_two_processors_carry_a_thousand_runs_out_in_little_more_than_half_their_processor_time(
    engine: str, tmp_path: Path
) -> None:
    content: dict[str, Any] = {
        **sweeps.SWEEP,
        "changes": [*ENGINES[engine], "duration:=5.0", "robot.hw:=franka_sim/FrankaHWSim"],
        "sweep": {**sweeps.SWEEP["sweep"], "runs": RUNS},
    }
    path = tmp_path / "gains.yaml"
    path.write_text(yaml.safe_dump(content))
    begun = time.monotonic()
    printed = sweeps.sweep(tmp_path, path, "--jobs", "2", enough=ENOUGH)
    wall = time.monotonic() - begun
    spent = table.load_sweep(sweeps.folder_of(printed))["processor"]
    print(
        f"\n{engine}: {spent.mean():.3f} s of processor a run (median {spent.median():.3f}, least {spent.min():.3f}); "
        f"{RUNS} runs in {wall:.0f} s, {wall / spent.sum():.2f} of their sum"
    )
    assert wall <= 0.6 * spent.sum()


@pytest.mark.slow
def test_handovers_with_a_muscle_driven_person_go_on_at_a_rate_that_is_printed(tmp_path: Path) -> None:
    content = definition.load("handover_population", quick=False).content
    content["sweep"]["runs"] = HANDOVERS
    path = tmp_path / "handovers.yaml"
    path.write_text(yaml.safe_dump(content))
    begun = time.monotonic()
    frame = table.load_sweep(sweeps.folder_of(sweeps.sweep(tmp_path, path, "--jobs", "2", enough=ENOUGH)))
    wall = time.monotonic() - begun
    print(
        f"\nhandover: {frame['processor'].mean():.2f} s of processor a run; {60 * HANDOVERS / wall:.1f} runs a minute"
    )
    assert (frame["failure"] == "").all() and len(frame) == HANDOVERS


@pytest.mark.slow  # each experiment twice on each engine
@pytest.mark.parametrize(
    "name", ["pd_step", "contact", "hand_guidance", "handover", "co_transport", "shared_workspace", "marker_tracking"]
)
def test_a_kept_process_runs_an_experiment_again_with_the_same_bits_on_each_engine(name: str) -> None:
    content, costs = experiment.read(name), list[str]()
    for engine in ("mujoco", "pybullet", "opensim"):
        given = RunTask(0, name, content, {"simulator": engine}, 0, {}, 60.0, "code")
        first, again = (task.run(given) for _ in range(2))
        assert first.failure == again.failure == "" and first.state_sha256 == again.state_sha256
        costs.append(f"{engine} {again.processor:.2f} s")
    print(f"\n{name}, {content['duration']:g} s of robot time: {', '.join(costs)} of processor a run")
