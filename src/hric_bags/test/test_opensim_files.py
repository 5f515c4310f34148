"""Files that a run on OpenSim writes for OpenSim's tools, read by OpenSim."""

from pathlib import Path

import numpy as np
import opensim
import pytest

import urdf_to_osim
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from hric_bags import reader as bag_reader
from hric_bags.export import opensim_files
from hric_bags.reader import ControlRecord
from hric_bags.run_folder import RunFolder
from hric_report import headless
from hric_run.definition import experiment

R_GROUND_BASE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from the base to OpenSim's ground: z of the base points along y of the ground."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    overrides = ("simulator:=opensim", "duration:=0.8", "friction:=identified")
    definition = experiment.load("pd_step", overrides)
    return headless.run(
        definition, overrides, root=tmp_path_factory.mktemp("runs"), progress=False, figures=False
    ).folder


@pytest.fixture(scope="module")
def log(folder: RunFolder) -> ControlRecord:
    return bag_reader.read(folder.bag_of(folder.read())).log


def test_opensim_replays_the_states_of_the_run_on_its_model(folder: RunFolder, log: ControlRecord) -> None:
    model = opensim.Model(str(folder.path / "model.osim"))
    model.initSystem()
    table = opensim.TimeSeriesTable(str(folder.path / "states.sto"))
    # Neither missing nor foreign columns are allowed.
    states = opensim.StatesTrajectory.createFromStatesTable(model, table, False, False)
    assert states.getSize() == log.cycles and states.isCompatibleWith(model)
    kdl = KdlFrankaModel(folder.urdf_path.read_text(), "panda")
    for k in (0, log.cycles // 2, log.cycles - 1):
        state = states.get(k)
        model.realizePosition(state)
        assert state.getTime() == pytest.approx(log.time[k], abs=1e-12)
        link = opensim.PhysicalFrame.safeDownCast(model.getComponent("/bodyset/panda_link7"))
        p_ground = link.getPositionInGround(state).to_numpy()
        p_base_link7 = np.array(kdl.pose(FrankaFrame.JOINT7, log.position[k]))[:3, 3]
        assert p_ground == pytest.approx(R_GROUND_BASE @ p_base_link7, abs=1e-9)


def test_the_model_of_the_run_is_proved_against_its_description(folder: RunFolder) -> None:
    options = opensim_files.options(folder.read())
    assert options.friction == "sigmoid" and len(options.friction_parameters) == 7
    assert urdf_to_osim.prove(folder.path / opensim_files.MODEL, folder.urdf_path.read_text(), options, states=5).passed


def test_the_report_again_writes_them_again(folder: RunFolder, log: ControlRecord) -> None:
    from hric_report.run import analyse

    (folder.path / "states.sto").unlink()
    analyse(folder, figures=False)
    table = opensim.TimeSeriesTable(str(folder.path / "states.sto"))
    column = table.getDependentColumn("/jointset/panda_joint4/panda_joint4/value").to_numpy()
    assert column == pytest.approx(log.position[:, list(log.joint_names).index("panda_joint4")], abs=1e-12)


def test_a_run_on_pybullet_leaves_none(tmp_path: Path) -> None:
    definition = experiment.load("pd_step", ("duration:=0.05",))
    result = headless.run(definition, (), root=tmp_path, progress=False, figures=False)
    assert not list(result.folder.path.glob("*.osim")) and not list(result.folder.path.glob("*.sto"))
    assert "<robot" in result.folder.urdf_path.read_text()
