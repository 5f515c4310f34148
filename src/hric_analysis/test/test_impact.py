"""Contacts of a human in a run, compared with a closed form and the commanded torque."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hric_analysis.human_values import HumanMetrics
from hric_assessment.contact import impact
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.json_values import from_json
from hric_report import human_text
from hric_report.figures import human as human_figures
from hric_report.html import run_data, run_page
from hric_report.html.page import render_page

WALL = "package://hric_experiments/worlds/wall_behind_arm.yaml"


@pytest.fixture(scope="module")
def clamped(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunFolder]:
    """Return a run in which the arm hits a forearm, pushes it against a wall, and continues to push."""
    root = tmp_path_factory.mktemp("runs")
    words = ["simulator:=mujoco", "robot.parameters.reflexes:=false", f"world:={WALL}", "human.parts:=right_arm"]
    assert main(["run", "contact", *words, "--quiet", "--no-figures", "--runs", str(root)]) == 0
    yield RunFolder((root / "latest").resolve())


@pytest.fixture(scope="module")
def found(clamped: RunFolder) -> dict[str, Any]:
    metrics: dict[str, Any] = json.loads((clamped.path / "metrics.json").read_text())
    return metrics


def test_the_first_peak_of_the_experiment_is_that_of_both_reflected_masses(found: dict[str, Any]) -> None:
    by_robot = [one for one in found["human"]["contacts"] if one["transient"]]
    blow = by_robot[0]
    assert blow["regions"] == ["lower arm, wrist"] and blow["speed"] > 0.2
    form = blow["transient"]
    assert form["peak"] == pytest.approx(blow["speed"] * math.sqrt(form["mass"] * 40e3))
    assert form["measured_peak"] == blow["peak"]
    assert form["ratio"] == pytest.approx(1.0, abs=0.03)
    assert blow["duration"] == pytest.approx(form["duration"], abs=3e-3)
    assert blow["impulse"] == pytest.approx(form["impulse"], rel=0.1)


def test_a_clamped_link_carries_what_the_commanded_torque_balances(found: dict[str, Any]) -> None:
    (press,) = [one["press"] for one in found["human"]["contacts"] if one["press"]]
    assert press["force"] > 10.0 and press["ratio"] == pytest.approx(1.0, abs=0.02)


def test_what_is_expected_is_beside_what_was_found_in_text_table_and_figures(
    clamped: RunFolder, found: dict[str, Any]
) -> None:
    text = human_text.render(from_json(HumanMetrics, found["human"]))
    assert "v sqrt(mu k) = " in text and "; commanded torque balances " in text
    assert text.count("touched panda::panda_hand") == 1 and " contacts, " in text
    data = run_data.load(clamped, found)
    figures = {figure.key: figure for figure in human_figures.figures(data)}
    blow, press = figures["blow"].panels[0], figures["press"].panels[0]
    expected, simulated = blow.curves
    ((_, peak),) = blow.bounds
    assert expected.values.max() == pytest.approx(peak, rel=1e-3)
    at = np.interp(simulated.time, expected.time, expected.values)
    rising = simulated.time < 0.5e3 * found["human"]["contacts"][0]["transient"]["duration"]
    assert rising.sum() > 4  # of 13 ms; then both have turned
    assert np.abs(simulated.values - at)[rising].max() < 0.02 * peak
    assert not figures["blow"].timed and figures["press"].timed
    assert figures["blow"].horizontal_range(blow) == (0.0, simulated.time[-1])
    balanced, contact = press.curves
    assert contact.values[-50:] == pytest.approx(balanced.values[-50:], rel=0.05)
    shown = render_page(replace(run_page.build(data), figures=[], robots=[]))
    rows = (
        shown[shown.index("<h3>Impacts compared with the closed form</h3>") :]
        .partition("</tbody>")[0]
        .partition("<tbody>")[2]
    )
    assert rows.count("<tr>") == sum(one["transient"] is not None for one in found["human"]["contacts"])


def test_a_run_whose_world_file_is_gone_tells_its_contacts_without_a_closed_form(clamped: RunFolder) -> None:
    run, record = clamped.read(), run_data.load(clamped, {"human": {}}).record
    run["parameters"]["robot"]["plant"]["world"] = "nowhere.yaml"
    person = run_data.load(clamped, {"human": {}}).person
    assert person is not None
    found = impact.expected_contacts(run, clamped.description(), record, person.record)
    assert len(found) == len(person.impacts) and not any(item.impact or item.clamping for item in found)
