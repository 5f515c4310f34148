"""Inverse dynamics of the robot along a run by OpenSim, compared with the torque in the control log."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import opensim

import urdf_to_osim
from hric_bags import text
from hric_bags.export import batches, opensim_files, recording
from hric_bags.export.opensim_text import write_storage
from hric_bags.export.recording import ExportSource
from hric_bags.export.solving import SolveError, exported, load_model, only, output_folder, output_to, run_tool
from hric_bags.export.table import FloatArray, TopicTable
from hric_bags.run_file import RunFile, robot_parameters
from hric_control.plants import rotor_inertia
from hric_core.trial.opensim_text import read_storage
from hric_core.urdf import read

MARGIN = 0.05
"""Time left out at both ends of the run, where the tool's splines are inexact [s]; project default, unconfirmed."""
EFFORT_AGE = 0.5
"""Mean age of a simulated robot's logged effort relative to its logged position [control periods].

The logged effort acted during the cycle before.
"""
FORCE_ENDINGS = {"rad": "_moment", "m": "_force"}
"""Unit of a coordinate -> ending that the tool appends to its name."""


@dataclass(frozen=True)
class InverseDynamics:
    """Result of the inverse dynamics: n instants of j joints.

    Attributes:
        joint_names: joints in the order of the columns.
        time: robot time, shape (n,) [s].
        torque: torque that the motion needs, shape (n, j) [N m].
        logged: measured torque in the control log, shape (n, j) [N m].
        rotor_inertia: rotor inertia of each joint that was considered, shape (j,) [kg m^2].
        file: .sto file with both torques.
        model: OpenSim model of the robot.
    """

    joint_names: tuple[str, ...]
    time: FloatArray
    torque: FloatArray
    logged: FloatArray
    rotor_inertia: tuple[float, ...]
    file: Path
    model: Path

    @property
    def error(self) -> FloatArray:
        """Difference of computed and logged torque, shape (n, j) [N m]."""
        return self.torque - self.logged


def solve(
    source: ExportSource, topic: str = "", lowpass: float = -1.0, rotor: float = 0.0, output: Path | None = None
) -> InverseDynamics:
    """Compute the inverse dynamics: export the coordinates, convert the robot, run OpenSim's tool.

    tau = M(q) ddq + C(q, dq) + g(q) + friction and damping of the URDF + B ddq. The logged torque is on the link side
    of the rotors, so B is zero unless the log has motor torques.

    Args:
        source: run with the robot's URDF.
        topic: topic of the control log; empty: the only one.
        lowpass: cut-off frequency of the tool's low-pass of the coordinates [Hz]; negative: no filter.
        rotor: rotor inertia B of each joint [kg m^2].
        output: output folder; None: inverse_dynamics in the run folder.

    Raises:
        HricError: there is no control log or no URDF, the robot cannot be converted, or the tool fails.
    """
    if not source.urdf:
        raise SolveError(
            f"inverse dynamics needs the robot's description: a run folder with robot.urdf; {source.bag.name} has none"
        )
    log = only(recording.read(source, types=(batches.CONTROL_LOG,)), topic, "control log")
    names = tuple(log.below("position"))
    inertia = rotor_inertia({"rotor_inertia": rotor}, names, read(source.urdf))
    folder = output_folder(source, "inverse_dynamics", output)
    model = _convert(source, folder / "model.osim")
    torques = folder / "torques.sto"
    _run(model, exported(source, "mot", log.topic), torques, log.time, lowpass)
    age = EFFORT_AGE if _simulated(source.run) else 0.0
    return _compared(log, names, inertia, age, torques, model, folder / "inverse_dynamics.sto")


def _simulated(run: RunFile) -> bool:
    robot = robot_parameters(run)
    return "plant" in robot or not str(robot.get("robot_hw", "")).startswith("franka_real")


def _convert(source: ExportSource, path: Path) -> Path:
    options = replace(opensim_files.options(source.run), meshes=False, stops=False)
    with output_to(Path(os.devnull)):
        urdf_to_osim.write(urdf_to_osim.convert(source.urdf, options), path)
    return path


def _run(model_path: Path, coordinates: Path, torques: Path, time: FloatArray, lowpass: float) -> None:
    model = load_model(model_path)
    tool = opensim.InverseDynamicsTool()
    tool.setModel(model)
    tool.setModelFileName(str(model_path))
    tool.setCoordinatesFileName(str(coordinates))
    tool.setLowpassCutoffFrequency(lowpass)
    tool.setStartTime(float(time[0]))
    tool.setEndTime(float(time[-1]))
    tool.setResultsDir(str(torques.parent))
    tool.setOutputGenForceFileName(torques.name)
    tool.printToXML(str(torques.with_name("setup.xml")))
    run_tool(tool, torques, "inverse dynamics")


def _compared(
    log: TopicTable,
    names: tuple[str, ...],
    inertia: tuple[float, ...],
    age: float,
    torques: Path,
    model: Path,
    file: Path,
) -> InverseDynamics:
    effort_time = log.time - age * float(np.median(np.diff(log.time)))
    solved = read_storage(torques)
    time, columns = solved.time, solved.columns
    velocity, effort = log.below("velocity"), log.below("effort")
    inside = (time >= log.time[0] + MARGIN) & (time <= log.time[-1] - MARGIN)
    time = time[inside]
    if len(time) < 2:
        raise SolveError(f"the run is too short for inverse dynamics: {log.time[-1] - log.time[0]:.3f} s")
    torque, logged = np.empty((len(time), len(names))), np.empty((len(time), len(names)))
    for j, name in enumerate(names):
        unit = next(column.unit for column in log.columns if column.name == f"position.{name}")
        acceleration = np.interp(time, log.time, np.gradient(velocity[name], log.time))
        torque[:, j] = columns[name + FORCE_ENDINGS[unit]][inside] + inertia[j] * acceleration
        logged[:, j] = np.interp(time, effort_time, effort[name])
    about = {
        "units": "time s; N m",
        "torque": "inverse dynamics with the rotor inertia of the option",
        "logged": f"effort of {log.topic}",
    }
    both = {f"torque.{name}": torque[:, j] for j, name in enumerate(names)} | {
        f"logged.{name}": logged[:, j] for j, name in enumerate(names)
    }
    write_storage(file, time, both, "Inverse dynamics", about=about)
    return InverseDynamics(names, time, torque, logged, inertia, file, model)


def render(dynamics: InverseDynamics) -> str:
    """Return the result of the inverse dynamics as text."""
    error = dynamics.error
    cells = [["joint", "|tau| max", "error max", "error rms", "rotor inertia"], ["", "N m", "N m", "N m", "kg m^2"]]
    for j, name in enumerate(dynamics.joint_names):
        row = [np.abs(dynamics.logged[:, j]).max(), np.abs(error[:, j]).max(), np.sqrt(np.mean(error[:, j] ** 2))]
        cells.append([name, *(f"{value:.4f}" for value in row), f"{dynamics.rotor_inertia[j]:g}"])
    head = f"torque that the motion needs against the torque logged, {len(dynamics.time)} instants"
    return (
        "\n".join([head, "", *text.rows(cells, head=2), "", f"torques: {dynamics.file}", f"model: {dynamics.model}"])
        + "\n"
    )
