"""Runs that are started from the window: form, refusals, progress, cancel, and the whole in a browser."""

import json
import os
import shlex
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import Browser, installed
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin

from hric_bags.run_folder import RunFolder
from hric_core.errors import HricError
from hric_run.definition import experiment
from hric_view.experiment_form import FormField, fields, hindrance, words
from hric_view.recordings import RecordedWindow, run_names
from hric_view.run_process import CANCELLED, DONE, FAILED, RUNNING, RunProcess, RunState
from hric_view.server import ViewServer

LONG = ["duration:=600"]
"""Override with which a run lasts far longer than a test."""
KP = "parameters.joint_pd_controller.kp"
LIMIT = 300.0
"""Longest wait for a process on a busy machine [s]."""


class TestForm:
    def test_a_parameter_has_unit_range_and_value(self) -> None:
        duration = by_key("pd_step")["duration"]
        assert (duration.kind, duration.value, duration.unit) == ("number", 6.0, "s")
        assert duration.valid == "above 0" and duration.text == "robot time of the complete run"

    def test_controllers_have_their_declared_parameters(self) -> None:
        one = by_key("pd_step")
        assert (one[KP].value, one[KP].unit, one[KP].valid) == (50.0, "N m/rad", "from 0")
        assert one["parameters.joint_pd_controller.profile.enabled"].kind == "flag"
        assert one["parameters.joint_pd_controller.gain_ramp"].value == 1.0

    def test_each_kind_of_parameter_is_told(self) -> None:
        one = by_key("contact")
        assert one["human.drive"].choices == ("torque", "muscle")
        assert one["setpoints.0.positions"].shown == "0.8, -pi/4, 0, -3*pi/4, 0, pi/2, pi/4"
        assert one["human.subject"].kind == "text" and one["robot.description.hand"].kind == "flag"

    @pytest.mark.parametrize("name", experiment.names())
    def test_every_key_is_an_override_of_its_value(self, name: str) -> None:
        set_ones = {one.key: one.value for one in fields(name) if one.value is not None}
        assert len(set_ones) > 10
        experiment.load(name, words(name, set_ones))

    def test_the_robot_and_paths_are_not_offered(self) -> None:
        assert not {"robot.hw", "robot.urdf", "robot.plant.world"} & by_key("co_transport").keys()
        assert "robot.plant_type" not in by_key("try_contact")

    @pytest.mark.parametrize("key", ["robot.hw", "robot.parameters.anything", "--runs", "duration:=1 robot.hw"])
    def test_an_unknown_key_is_refused(self, key: str) -> None:
        with pytest.raises(HricError, match="parameter"):
            words("pd_step", {key: 1})

    @pytest.mark.parametrize(
        "value", ["/etc/passwd", "a.yaml", "~/x", "package://x", {"a": 1}, [[1]], None, "$(ls)", "a\nb"]
    )
    def test_a_value_that_is_not_plain_is_refused(self, value: Any) -> None:
        with pytest.raises(HricError, match="no paths"):
            words("pd_step", {"duration": value})

    def test_a_value_is_one_word_of_the_command(self) -> None:
        assert words("pd_step", {"description": "a b", KP: [1, 2.5]}) == ["description:=a b", f"{KP}:=[1, 2.5]"]

    def test_an_experiment_with_wires_is_not_offered(self) -> None:
        assert hindrance("pd_step") == "" and "cannot run headless" in hindrance("data_collection")


def by_key(name: str) -> dict[str, FormField]:
    return {field.key: field for field in fields(name)}


@pytest.fixture
def process(tmp_path: Path) -> Iterator[RunProcess]:
    made = RunProcess(tmp_path / "runs")
    yield made
    made.close()


def wait(process: RunProcess, until: Callable[[RunState], object]) -> RunState:
    """Return the state of a run as soon as a condition holds."""
    deadline = time.monotonic() + LIMIT
    while not until(process.state):
        assert time.monotonic() < deadline, process.state
        time.sleep(0.05)
    return process.state


def ended(state: RunState) -> bool:
    return state.phase != RUNNING


class TestProcess:
    def test_a_run_has_its_folder_when_it_is_done(self, process: RunProcess, tmp_path: Path) -> None:
        process.start("pd_step", ["duration:=0.5"])
        state = wait(process, ended)
        assert (state.phase, state.duration) == (DONE, 0.5)
        assert [state.folder] == run_names(tmp_path / "runs")

    def test_a_refused_value_has_the_text_of_the_check(self, process: RunProcess, tmp_path: Path) -> None:
        process.start("pd_step", ["duration:=-1"])
        state = wait(process, ended)
        with pytest.raises(HricError) as refusal:
            experiment.load("pd_step", ["duration:=-1"])
        assert (state.phase, state.text) == (FAILED, str(refusal.value))
        assert not (tmp_path / "runs").exists()

    def test_a_second_run_waits_for_the_first(self, process: RunProcess) -> None:
        process.start("pd_step", LONG)
        with pytest.raises(HricError, match="pd_step is running"):
            process.start("contact", [])

    def test_cancel_ends_the_process_and_keeps_the_recording(self, process: RunProcess, tmp_path: Path) -> None:
        process.start("pd_step", LONG)
        assert wait(process, lambda state: state.time).duration == 600.0
        process.cancel()
        assert wait(process, ended).phase == CANCELLED
        (name,) = run_names(tmp_path / "runs")
        assert RunFolder(tmp_path / "runs" / name).read()["status"] == "interrupted"

    def test_a_killed_process_is_told(self, process: RunProcess) -> None:
        process.start("pd_step", LONG)
        wait(process, lambda state: state.time)
        os.kill(child(), signal.SIGKILL)
        state = wait(process, ended)
        assert (state.phase, state.text, state.folder) == (FAILED, "hric run was killed by SIGKILL", "")

    def test_a_missing_program_is_told(self, process: RunProcess, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("PATH", "")
        process.start("pd_step", [])
        assert "cannot be started: No such file" in wait(process, ended).text

    def test_closing_the_window_ends_the_process(self, process: RunProcess) -> None:
        process.start("pd_step", LONG)
        wait(process, lambda state: state.time)
        number = child()
        process.close()
        assert not Path(f"/proc/{number}").exists()


def child() -> int:
    """Return the number of the child process `hric run`."""
    numbers = [int(path.parent.name) for path in Path("/proc").glob("[0-9]*/stat") if parent(path) == os.getpid()]
    (found,) = [one for one in numbers if b"pd_step" in Path(f"/proc/{one}/cmdline").read_bytes()]
    return found


def parent(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except OSError:  # it has ended
        return 0


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ViewServer]:
    window = RecordedWindow(tmp_path / "runs")
    made = ViewServer(window, receiver=window.new)
    yield made
    window.new.close()
    made.close()


def client(server: ViewServer) -> Any:
    """Return the connection of a viewer of a form."""
    origin, _, query = server.address.partition("/?")
    address = f"{origin.replace('http', 'ws')}/socket?experiment=pd_step&{query}"
    return connect(address, origin=Origin(origin), close_timeout=0.1)


def answer(viewer: Any, **message: Any) -> dict[str, Any]:
    """Send a message and return the next one of the server."""
    viewer.send(json.dumps(message))
    response: dict[str, Any] = json.loads(viewer.recv(LIMIT))
    return response


class TestMessages:
    def test_a_check_answers_with_the_command(self, server: ViewServer) -> None:
        with client(server) as viewer:
            assert json.loads(viewer.recv(LIMIT))["phase"] == ""
            line = answer(viewer, command="check", experiment="pd_step", values={KP: 200})["line"]
            assert shlex.split(line)[:5] == ["hric", "run", "pd_step", f"{KP}:=200", "--runs"]

    def test_a_refused_value_keeps_the_connection(self, server: ViewServer) -> None:
        with client(server) as viewer:
            viewer.recv(LIMIT)
            refusal = answer(viewer, command="check", experiment="pd_step", values={"duration": -1})
            assert refusal["type"] == "refused" and "duration is -1; valid: a finite number above 0" in refusal["text"]
            assert answer(viewer, command="state")["type"] == "state"

    def test_all_viewers_see_the_one_run(self, server: ViewServer) -> None:
        with client(server) as first, client(server) as second:
            for viewer in (first, second):
                viewer.recv(LIMIT)
            assert answer(first, command="run", experiment="pd_step", values={"duration": 600})["phase"] == RUNNING
            other = answer(second, command="run", experiment="contact", values={})
            assert other["type"] == "refused" and "pd_step is running" in other["text"]
            assert answer(second, command="state")["experiment"] == "pd_step"

    @pytest.mark.parametrize("name", ["../pd_step", "/tmp/pd_step.yaml", "none", "", "contact_study"])
    def test_only_experiments_of_the_list_are_run(self, server: ViewServer, name: str) -> None:
        with client(server) as viewer:
            viewer.recv(LIMIT)
            assert "experiment" in answer(viewer, command="run", experiment=name, values={})["text"]

    def test_an_experiment_with_wires_is_refused(self, server: ViewServer) -> None:
        with client(server) as viewer:
            viewer.recv(LIMIT)
            refusal = answer(viewer, command="run", experiment="data_collection", values={})
            assert "cannot run headless" in refusal["text"]

    @pytest.mark.parametrize(
        "message",
        ['{"command":"rm"}', '{"command":"run"}', '{"command":"cancel","also":1}', '{"command":[]}', "1"],
    )
    def test_a_message_of_no_page_closes_the_connection(self, server: ViewServer, message: str) -> None:
        with client(server) as viewer, pytest.raises(ConnectionClosed):
            viewer.send(message)
            for _ in range(3):
                viewer.recv(LIMIT)


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
def test_from_the_list_to_the_replay_of_a_changed_run(server: ViewServer, tmp_path: Path) -> None:
    with Browser(tmp_path / "profile") as page:
        page.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        page.open_address(server.address)
        for words in ("new run", "pd_step"):
            page.evaluate(f"[...document.querySelectorAll('a')].find((one) => one.textContent === '{words}').click()")
            page.wait("document.title.startsWith('New run')")
        page.wait("document.getElementById('line')?.textContent.startsWith('hric run pd_step')")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        enter(page, "duration", "-1")
        page.wait("document.getElementById('mistake').textContent.includes('above 0')")
        enter(page, "duration", "0.5")
        enter(page, KP, "60")
        page.wait(f"document.getElementById('line').textContent.includes('{KP}:=60')")
        assert page.evaluate("document.querySelectorAll('.changed').length") == 2
        page.evaluate("document.getElementById('run').click()")
        page.wait("typeof report !== 'undefined' && report.started === true", LIMIT)
        (name,) = run_names(tmp_path / "runs")
        assert page.evaluate("document.title") == name
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        ours = server.address.partition("?")[0].partition("//")[2]
        assert page.problems == [] and all(one.partition("//")[2].startswith(ours) for one in page.requests)
    run = RunFolder(tmp_path / "runs" / name).read()
    assert run["arguments"] == ["duration:=0.5", f"{KP}:=60"]
    assert run["definition"]["duration"] == 0.5


def enter(page: Browser, key: str, text: str) -> None:
    """Enter a text in the input of a parameter, as a user does."""
    page.evaluate(
        f"(() => {{ const input = document.getElementById('{key}'); input.value = '{text}'; "
        "for (const kind of ['input', 'change']) input.dispatchEvent(new Event(kind, { bubbles: true })); })()"
    )
