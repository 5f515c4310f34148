"""Fixtures of the integration tests: a shared bring-up for tests that do not change it, and separate ones."""

import os
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts/lib"))
from live_system import READY_TIMEOUT, LiveSystem, PdStep, wait_for

from hric_run.definition import parameters


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run tests with separate bring-ups first, before the shared one loads the machine."""
    items.sort(key=_is_on_the_shared_one)


def _is_on_the_shared_one(item: pytest.Item) -> bool:
    """Return True if a test uses the fixture `live`, directly or by a parameter with its name."""
    given = item.callspec.params.values() if hasattr(item, "callspec") else ()
    return "live" in [*getattr(item, "fixturenames", ()), *(value for value in given if isinstance(value, str))]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., LiveSystem]]:
    """Return a function that starts bring-ups, which are ended after the test."""
    systems: list[LiveSystem] = []

    def started(*arguments: str, **environment: str) -> LiveSystem:
        folder = tmp_path / f"system{len(systems)}"
        folder.mkdir()
        systems.append(LiveSystem(folder, *arguments, **environment))
        return systems[-1]

    yield started
    for system in systems:
        system.close()


@pytest.fixture(scope="session")
def pd_step(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PdStep]:
    """Bring-up with the experiment pd_step, which runs once for all tests that check its results."""
    system = LiveSystem(tmp_path_factory.mktemp("pd_step"), "env:=sim", "rviz:=false", "experiment:=pd_step")
    try:
        services = system.services_of_a_run()
        system.wait(timeout=90.0)
        yield PdStep(system, services)
    finally:
        system.close()


@pytest.fixture(scope="session")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveSystem]:
    """Default bring-up, with this process as another node on its master."""
    system = LiveSystem(tmp_path_factory.mktemp("live"), "env:=sim", "rviz:=false")
    try:
        system.wait_running("joint_state_controller", "franka_state_controller", "joint_pd_controller")
        configured = set(parameters.defaults("panda"))
        wait_for(
            lambda: configured <= set(system.controllers()),
            READY_TIMEOUT,
            f"{configured} loaded; output:\n{system.output}",
        )
        os.environ.update({key: system.environment[key] for key in ("ROS_MASTER_URI", "ROS_IP", "ROS_HOME")})
        warnings.simplefilter("ignore", ResourceWarning)
        import rospy

        rospy.init_node("integration_tests", disable_signals=True)
        yield system
        rospy.signal_shutdown("end of the tests")
    finally:
        system.close()
