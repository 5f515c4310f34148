"""Default bring-up on all three engines: same nodes, topics, services and behaviour."""

import json
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing

import numpy as np
import pytest
from bags import control_log, gaps_and_repeats, topics
from live_system import LiveSystem, PdStep

pytestmark = pytest.mark.alone

ENGINES = ("opensim", "mujoco")
NOT_OF_EACH = {"/sim/joint_reactions", "/sim/contacts"}
"""Topics not compared: PyBullet has no joint reactions, and the only message of contacts may precede the recorder."""


def ran(system: LiveSystem) -> PdStep:
    """Wait for the end of a bring-up; return it with the services that it offered."""
    services = system.services_of_a_run()
    system.wait(timeout=150.0)
    return PdStep(system, services)


@pytest.fixture(scope="module")
def runs(pd_step: PdStep, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Future[PdStep]]]:
    """Bring-ups with the experiment on each engine, run in parallel, as they mostly wait for their time to pass."""
    with ExitStack() as stack:
        systems, beside = {}, stack.enter_context(ThreadPoolExecutor())
        for engine in ENGINES:
            words = ("env:=sim", f"simulator:={engine}", "rviz:=false", "experiment:=pd_step")
            systems[engine] = stack.enter_context(closing(LiveSystem(tmp_path_factory.mktemp(engine), *words)))
        yield {engine: beside.submit(ran, system) for engine, system in systems.items()}


@pytest.mark.parametrize("engine", ENGINES)
def test_pd_step_runs_on_each_engine_with_the_topics_and_services_of_pybullet(
    engine: str, runs: dict[str, Future[PdStep]], pd_step: PdStep
) -> None:
    run = runs[engine].result()
    system = run.system
    assert system.process.returncode == 0, system.output
    assert system.processes() == {}
    assert run.services == pd_step.services
    bags = [next(one.run_folder.glob("*.bag")) for one in (system, pd_step.system)]
    assert topics(bags[0]) - NOT_OF_EACH == topics(bags[1]) - NOT_OF_EACH
    cycles, times = control_log(bags[0])
    assert gaps_and_repeats(cycles) == (0, 0) and len(cycles) >= 6000
    assert np.all(np.diff(times) > 0.0)
    metrics = json.loads((system.run_folder / "metrics.json").read_text())
    assert metrics["setpoints"][0]["final_error_max"] < 1e-3
    for name in ("model.osim", "states.sto"):
        assert (system.run_folder / name).is_file() == (engine == "opensim")
