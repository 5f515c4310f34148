"""For all tests of the workspace: helpers beside tests can be imported, markers of whole files, figures, and what was
not selected."""

import functools
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

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: matrices of seven rows gain nothing from threads
os.environ.setdefault("MUJOCO_GL", "egl")  # read when MuJoCo is loaded, by whichever test comes first: some draw
ROOT = Path(__file__).parent
MARKS_OF_A_FILE = re.compile(r"^pytestmark = (?:\[[^\]]*\]|.*)", re.MULTILINE)
MASTERS = ("roscore", "start", "live", "pd_step")
"""Fixtures that start a ROS master."""
# A helper file beside the tests of a package is imported by its name, which must be unique in the workspace.
sys.path[:0] = [
    str(folder)
    for folder in sorted(
        [*ROOT.glob("src/*/test"), *(ROOT / "tests" / name for name in ("", "integration", "benchmarks", "manual"))]
    )
    if str(folder) not in sys.path
]


@functools.cache
def marks_of_file(path: Path) -> frozenset[str]:
    """Names of the markers that a test file gives all of its tests by `pytestmark = ...`, read without loading the
    file."""
    return frozenset(re.findall(r"pytest\.mark\.(\w+)", " ".join(MARKS_OF_A_FILE.findall(path.read_text()))))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """A run of those that run alone, or of the others, loads no file of the other kind: loading all takes longer than
    most tests."""
    if not collection_path.name.startswith("test_") or collection_path.suffix != ".py":
        return None
    unwanted = "not alone" if "alone" in marks_of_file(collection_path) else "alone"
    return unwanted in config.option.markexpr.split(" and ") or None


def kind(item: pytest.Item) -> str:
    """What a test counts as in the closing line."""
    if item.get_closest_marker("rostest"):
        return "rostest"
    if "benchmarks" in item.path.parts:
        return "benchmark"
    return "integration" if "integration" in item.path.parts else "unit"


def runs_on(item: pytest.Item) -> str | None:
    """Back end of a test of the contract, or engine of a test of plants, by its parameter; None of other tests."""
    given = item.callspec.params if hasattr(item, "callspec") else {}
    return given.get("backend") or given.get("plant_type", "").partition("_ros_control/")[0] or None


def needs_to_be_alone(item: pytest.Item) -> str | None:
    """Why a test must be in a file that is marked `alone`; None where nothing is known that speaks for it."""
    given = item.callspec.params if hasattr(item, "callspec") else {}  # parameters of the test itself, of whatever name
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
                f"{item.nodeid}: {reason}, so its file must say `{wanted}`, since nothing may run beside it"
            )


class NotSelected:
    """Counts what -m and -k left out, once however many processes share the tests, and tells it in the JUnit file."""

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
        """Each process of pytest-xdist selects among all tests: what one tells is all."""
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
    """figure("whole cycle to bare step", 3.2, "1"): a measured value and its unit, for the table at the end of
    scripts/test."""

    def noted(name: str, value: float, unit: str) -> None:
        print(f"{name}: {value:.4g} {unit}")
        request.node.user_properties.append(("figure", json.dumps([name, float(value), unit])))

    return noted


@contextmanager
def _log_as_it_was() -> Iterator[None]:
    """A node in the test's process sends what "hric" logs to rosout, and nowhere else: not for the tests that
    follow."""
    logger = logging.getLogger("hric")
    level, kept = logger.level, (logger.propagate, logger.handlers[:])
    yield
    logger.propagate, logger.handlers[:] = kept
    logger.setLevel(level)  # also empties the logger's cache of what is enabled


@contextmanager
def _parameters_as_they_were(request: pytest.FixtureRequest) -> Iterator[None]:
    """Parameters that nodes and command lines leave on the shared master would be those of a node of the same name in
    a test that follows."""
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
    """A fixture of the whole file may hold a node, too; one of the session, made before this, logs as at the start."""
    logger = logging.getLogger("hric")
    logger.propagate, logger.handlers[:] = True, []
    logger.setLevel(logging.NOTSET)
    with _log_as_it_was(), _parameters_as_they_were(request):
        yield
