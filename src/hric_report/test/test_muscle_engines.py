"""A human moved by muscles guides the robot's hand: equal on each engine."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hric_bags import reader as bag_reader
from hric_bags.reader import RunRecord
from hric_bags.records import human_record
from hric_bags.records.human_record import HumanRecord
from hric_report import headless as runner
from hric_run.definition import experiment

DURATION = 3.0
"""Covers the motion to the end point and a pause; the way back is the same motion reversed [s]."""


def guided(engine: str, root: Path) -> tuple[RunRecord, HumanRecord]:
    overrides = [f"simulator:={engine}", f"duration:={DURATION}", "human.drive:=muscle"]
    definition = experiment.load("hand_guidance", overrides)
    folder = runner.run(definition, overrides, root=root, progress=False, figures=False).folder
    record = bag_reader.read(folder.bag_path)
    found = human_record.read(folder.bag_path, record.robot_time)
    assert found is not None and found.muscles is not None
    return record, found


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunRecord, HumanRecord]:
    return guided("mujoco", tmp_path_factory.mktemp("mujoco"))


@pytest.mark.parametrize("engine", ["pybullet", "opensim"])
def test_muscles_lead_the_robot_as_on_another_engine(
    engine: str,
    reference: tuple[RunRecord, HumanRecord],
    tmp_path: Path,
    figure: Callable[[str, float, str], None],
) -> None:
    (robot, human), (expected_robot, expected) = guided(engine, tmp_path), reference
    assert human.muscles is not None and expected.muscles is not None
    joints = max(
        float(np.abs(robot.log.position - expected_robot.log.position).max()),
        float(np.abs(human.position - expected.position).max()),
    )
    force = np.linalg.norm(human.grips["guide"].force - expected.grips["guide"].force, axis=1).max()
    activation = np.sqrt(np.mean((human.muscles.activation - expected.muscles.activation) ** 2))
    figure(f"guidance by muscles, {engine} beside mujoco: joints, largest", joints, "rad")
    figure(f"guidance by muscles, {engine} beside mujoco: grip force, largest", float(force), "N")
    figure(f"guidance by muscles, {engine} beside mujoco: activation, rms", float(activation), "1")
    assert np.ptp(expected_robot.log.position, axis=0).max() > 0.1
    assert np.abs(expected.grips["guide"].force).max() > 5.0
    assert np.ptp(expected.muscles.activation, axis=0).max() > 0.03
    assert joints <= 5e-3 and force <= 0.1 and activation <= 0.01
