"""pytest configuration of all tests: import paths of helper modules, checks of markers, the fixture `figure`, counts of
unselected tests, and restoration of loggers and ROS parameters after each test."""

import functools
import gc
import json
import logging
import os
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from _pytest.junitxml import xml_key

# Before numpy and MuJoCo are imported: matrices of seven rows are not faster with threads, and some tests draw.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MUJOCO_GL", "egl")
ROOT = Path(__file__).parent
MARKS_OF_A_FILE = re.compile(r"^pytestmark = (?:\[[^\]]*\]|.*)", re.MULTILINE)
MASTERS = ("roscore", "start", "live", "pd_step")
"""Names of fixtures that start a ROS master."""
# Helper modules in the test folders are imported by their name, which must be unique in the workspace.
sys.path[:0] = [
    str(folder)
    for folder in sorted(
        [*ROOT.glob("src/*/test"), *(ROOT / "tests" / name for name in ("", "integration", "benchmarks", "manual"))]
    )
    if str(folder) not in sys.path
]


@functools.cache
def marks_of_file(path: Path) -> frozenset[str]:
    """Return the names of the markers in `pytestmark = ...` of a test file, without importing the file."""
    return frozenset(re.findall(r"pytest\.mark\.(\w+)", " ".join(MARKS_OF_A_FILE.findall(path.read_text()))))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Skip files marked `alone` in a run of the other tests, and vice versa: importing takes longer than most tests."""
    if not collection_path.name.startswith("test_") or collection_path.suffix != ".py":
        return None
    unwanted = "not alone" if "alone" in marks_of_file(collection_path) else "alone"
    return unwanted in config.option.markexpr.split(" and ") or None


def pytest_collection_finish() -> None:
    """Exempt what exists now from garbage collection, which would walk through it again and again."""
    gc.collect()
    gc.freeze()


def kind(item: pytest.Item) -> str:
    """Return the kind of a test in the closing line: rostest, benchmark, integration or unit."""
    if item.get_closest_marker("rostest"):
        return "rostest"
    if "benchmarks" in item.path.parts:
        return "benchmark"
    return "integration" if "integration" in item.path.parts else "unit"


def runs_on(item: pytest.Item) -> str | None:
    """Return the backend of a contract test or the engine of a plant test, by its parameters; None for other tests."""
    given = item.callspec.params if hasattr(item, "callspec") else {}
    return given.get("backend") or given.get("plant_type", "").partition("_ros_control/")[0] or None


def needs_to_be_alone(item: pytest.Item) -> str | None:
    """Return the reason why a test must be in a file marked `alone`; None if there is none."""
    given = (
        item.callspec.params if hasattr(item, "callspec") else {}
    )  # parameters of the test, which may have the name of a fixture
    if masters := [name for name in getattr(item, "fixturenames", ()) if name in MASTERS and name not in given]:
        return f"it starts a ROS master (fixture {masters[0]})"
    marks = [name for name in ("alone", "live", "rostest") if item.get_closest_marker(name)]
    return f"it is marked {marks[0]}" if marks else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        item.user_properties.append(("kind", kind(item)))
        if robot := runs_on(item):
            item.user_properties.append(("runs on", robot))
        if "alone" not in marks_of_file(item.path) and (reason := needs_to_be_alone(item)):
            wanted = "pytestmark = pytest.mark.alone"
            raise pytest.UsageError(
                f"{item.nodeid}: {reason}, so its file must contain `{wanted}`: no other test may run at the same time"
            )


class NotSelected:
    """Counter of the tests deselected by -m and -k, for any number of processes; writes to the JUnit file."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._counts = config, Counter[str]()
        self._terms = [term for term in config.option.markexpr.split(" and ") if term]

    def _reason(self, item: pytest.Item) -> str:
        for term in self._terms:
            name = term.removeprefix("not ")
            if (item.get_closest_marker(name) is not None) == (name != term):
                return name if name != term else f"not {name}"
        return "other options"

    def pytest_deselected(self, items: list[pytest.Item]) -> None:
        self._counts.update(map(self._reason, items))

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: object) -> None:
        """Take the counts of one process of pytest-xdist, since each process selects among all tests."""
        self._counts = Counter(getattr(node, "workeroutput", {}).get("not selected", self._counts))

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self) -> None:
        if hasattr(self._config, "workeroutput"):
            self._config.workeroutput["not selected"] = dict(self._counts)
        elif xml := self._config.stash.get(xml_key, None):
            xml.add_global_property("not selected", json.dumps(self._counts))


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(NotSelected(config), "hric-not-selected")


@pytest.fixture
def figure(request: pytest.FixtureRequest) -> Callable[[str, float, str], None]:
    """Return a function that records a measured value for the table at the end of scripts/test.

    Example: figure("whole cycle to bare step", 3.2, "1") with name, value and unit.
    """

    def noted(name: str, value: float, unit: str) -> None:
        print(f"{name}: {value:.4g} {unit}")
        request.node.user_properties.append(("figure", json.dumps([name, float(value), unit])))

    return noted


@contextmanager
def _log_as_it_was() -> Iterator[None]:
    """Restore the logger "hric" afterwards, since a node in the process redirects its messages to rosout."""
    logger = logging.getLogger("hric")
    level, kept = logger.level, (logger.propagate, logger.handlers[:])
    yield
    logger.propagate, logger.handlers[:] = kept
    logger.setLevel(level)  # also clears the logger's cache of enabled levels


@contextmanager
def _parameters_as_they_were(request: pytest.FixtureRequest) -> Iterator[None]:
    """Delete new ROS parameters on the shared master afterwards, since later nodes of the same name would read them."""
    if "roscore" not in request.fixturenames:
        yield
        return
    import rosgraph

    master = rosgraph.Master("/tests", request.getfixturevalue("roscore"))
    kept = set(master.getParamNames())
    yield
    for name in set(master.getParamNames()) - kept:
        master.deleteParam(name)


@pytest.fixture(autouse=True)
def _as_before_the_test(request: pytest.FixtureRequest) -> Iterator[None]:
    with _log_as_it_was(), _parameters_as_they_were(request):
        yield


@pytest.fixture(autouse=True, scope="module")
def _as_before_the_file(request: pytest.FixtureRequest) -> Iterator[None]:
    """Reset the logger before a file; restore logger and parameters after it, as module fixtures may run a node."""
    logger = logging.getLogger("hric")
    logger.propagate, logger.handlers[:] = True, []
    logger.setLevel(logging.NOTSET)
    with _log_as_it_was(), _parameters_as_they_were(request):
        yield
