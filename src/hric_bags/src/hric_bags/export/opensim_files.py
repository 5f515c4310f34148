"""OpenSim model and states of a run on OpenSim, for OpenSim's tools, made from the run folder alone."""

from pathlib import Path
from typing import Any

import numpy as np
import opensim

import urdf_to_osim
from hric_bags.files import atomic
from hric_bags.reader import ControlRecord
from hric_bags.run_file import RunFile, robot_parameters
from hric_bags.run_folder import RunFolder

MODEL, STATES = "model.osim", "states.sto"
FRICTIONS = {"none": "none", "coulomb": "coulomb", "identified": "sigmoid"}
"""Friction law of the simulated plant -> name of that law in the converter urdf_to_osim."""


def write(folder: RunFolder, run: RunFile, log: ControlRecord) -> None:
    """Write model.osim (with Geometry/) and states.sto, replacing existing files.

    The states are those of the control log; joints that are not in it have the default of the model.

    Raises:
        HricError: the robot description cannot be converted, or the files cannot be written.
    """
    urdf = folder.urdf_path.read_text()
    conversion = urdf_to_osim.convert(urdf, options(run))
    urdf_to_osim.write(conversion, folder.path / MODEL)
    _write_states(conversion, log, folder.path / STATES)


def options(run: RunFile) -> urdf_to_osim.Options:
    """Return the options for converting a run's robot, with the friction in that run; run: contents of run.yaml."""
    plant = robot_parameters(run).get("plant") or {}
    law = FRICTIONS[plant.get("friction", "none")]
    parameters = plant.get("friction_parameters") or {} if law == "sigmoid" else {}
    return urdf_to_osim.Options(inertia="keep", friction=law, friction_parameters=parameters)


def _write_states(conversion: urdf_to_osim.Conversion, log: ControlRecord, path: Path) -> None:
    model = conversion.model
    state = model.initSystem()
    columns: list[str] = []
    values: list[Any] = []
    for joint in conversion.joints.values():
        for coordinate in joint.paths:
            default = opensim.Coordinate.safeDownCast(model.getComponent(coordinate))
            columns += [f"{coordinate}/value", f"{coordinate}/speed"]
            values += [np.full(log.cycles, default.getValue(state)), np.zeros(log.cycles)]
    for j, name in enumerate(log.joint_names):
        (coordinate,) = conversion.joints[name].paths
        k = columns.index(f"{coordinate}/value")
        values[k], values[k + 1] = log.position[:, j], log.velocity[:, j]
    matrix = opensim.Matrix.createFromMat(np.ascontiguousarray(np.array(values).T))
    table = opensim.TimeSeriesTable(log.time.tolist(), matrix, columns)
    table.addTableMetaDataString("inDegrees", "no")
    with atomic(path) as temporary:
        opensim.STOFileAdapter.write(table, str(temporary))
