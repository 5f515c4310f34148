"""Contact of a person who walked to a place, and of one who was spawned there: equal verdict, closed form and page."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hric_assessment.findings import Finding
from hric_assessment.verdict import assess, opened
from hric_report import headless as runner
from hric_report.html import human_and_objects, metrics_of, run_data
from hric_run.definition import experiment

WALKED = (-0.3, -0.2)
"""Displacement of the spawn position; the person walks back by it [m]."""


def contact_run(root: Path, walked: tuple[float, float] | None) -> runner.RunFolder:
    content = yaml.safe_load((experiment.config_path("experiments") / "contact.yaml").read_text())
    human: dict[str, Any] = content["human"]
    if walked is not None:
        reference = human["control"]["parameters"]["reference"]
        human["position"] = [a + b for a, b in zip(human["position"], walked, strict=True)]
        reference["points"] = [[t, x + walked[0], y + walked[1], z] for t, x, y, z in reference["points"]]
        human["walk"] = {"points": [[0.0, -walked[0], -walked[1]]]}
    path = root / "contact.yaml"
    path.write_text(yaml.safe_dump(content))
    words = ["simulator:=mujoco", "duration:=1.5"]
    return runner.run(experiment.load(str(path), words), words, root=root, progress=False, figures=False).folder


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    return [contact_run(tmp_path_factory.mktemp("runs"), walked) for walked in (None, WALKED)]


def first(run: Any, group: str) -> Finding:
    found = [one for one in assess(opened(str(run.path))).findings if one.group == group]
    return min(found, key=lambda one: one.window or (0.0, 0.0))


def test_the_closed_form_has_their_mass_where_the_person_was_and_not_where_the_person_was_spawned(
    runs: list[Any],
) -> None:
    stood, walked = (first(run, "contact").values for run in runs)
    mass, name = "reflected mass of the body as simulated [kg]", "v sqrt(mu k) as simulated [N]"
    assert walked[mass] == pytest.approx(stood[mass], rel=0.05)
    assert walked["transient peak [N]"] == pytest.approx(stood["transient peak [N]"], rel=0.05)
    ratios = [float(one["transient peak [N]"] or 0.0) / float(one[name] or np.nan) for one in (stood, walked)]
    assert ratios[1] == pytest.approx(ratios[0], rel=0.03)


def test_the_distance_is_measured_from_where_the_person_was(runs: list[Any]) -> None:
    stood, walked = (first(run, "separation") for run in runs)
    assert walked.values["smallest distance [m]"] == pytest.approx(stood.values["smallest distance [m]"], abs=5e-3)
    assert any(topic.endswith("human/root") for topic in walked.signals)


def test_the_page_moves_their_body_by_the_recorded_root(runs: list[Any]) -> None:
    stood, walked = (human_and_objects.human(run_data.load(run, metrics_of(run)), 50.0)[0] for run in runs)
    assert stood.motion is None and walked.motion is not None
    place = np.array(stood.pose.position)
    assert np.allclose(walked.motion.values[:, :3], place, atol=5e-3)
    assert not np.allclose(walked.pose.position, place, atol=0.1)
