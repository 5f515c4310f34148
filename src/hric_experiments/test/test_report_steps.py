"""Progress messages of a report, and behaviour after Ctrl-C."""

import io
from pathlib import Path
from typing import Any

import pytest
import report_run
import rospy

from hric_bags import reader as bag_reader
from hric_bags.text import Steps
from hric_experiments.live import experiment as live
from hric_experiments.live.node import LiveInterrupted
from hric_experiments.live.recording import LiveRecording
from hric_report import run as analysis
from hric_report import run_figures


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_in_a_file_each_step_is_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    step = Steps(2)
    step("reading")
    step("drawing")
    step.close()
    assert capsys.readouterr().err == "report, step 1 of 2 (0 s): reading\nreport, step 2 of 2 (0 s): drawing\n"


def test_on_a_terminal_one_line_changes_and_is_free_again_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stderr", terminal)
    step = Steps(2)
    step("reading")
    step("drawing")
    step.close()
    text = terminal.getvalue()
    assert "\n" not in text and text.count("\r") == 3 and text.endswith("\r\033[K")


@pytest.mark.parametrize(
    ("figures", "count"), [(False, analysis.STEPS), (True, analysis.STEPS + analysis.FIGURE_STEPS)]
)
def test_an_analysis_has_as_many_steps_as_it_announces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, figures: bool, count: int
) -> None:
    monkeypatch.setattr("hric_report.drawing.draw", lambda *_: [])
    steps: list[str] = []
    analysis.analyse(report_run.write_run(tmp_path), figures=figures, step=steps.append)
    assert len(steps) == count and steps[0] == "reading the control log"


def live_experiment(html: bool = False) -> live.LiveExperiment:
    made = object.__new__(live.LiveExperiment)
    made._settings = live.ExperimentSettings(experiment="made_up", html=html)
    return made


def test_ctrl_c_during_the_report_leaves_the_bag_whole_and_says_how_to_make_it_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: said.append(text % values))

    def interrupted(*_: Any, **__: Any) -> None:
        raise LiveInterrupted

    monkeypatch.setattr(run_figures, "draw", interrupted)
    folder = report_run.write_run(tmp_path)
    recording = object.__new__(LiveRecording)
    recording._folder = str(folder.path)
    with pytest.raises(LiveInterrupted):
        live_experiment()._report(recording)
    assert said == [f"interrupted: the bag is complete, but there is no report; to write it: hric report {folder.path}"]
    assert bag_reader.read(folder.bag_path).log.cycles == report_run.CYCLES
