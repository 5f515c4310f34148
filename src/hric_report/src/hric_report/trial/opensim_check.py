"""Comparison of a trial's joint angles and moments with those of OpenSim's inverse kinematics and inverse dynamics.

    rows = differences(result, moments, folder)         # one for each program and joint

Both tools get the data that this project used: the fitted body with its fitted marker positions, the measured marker
positions, the smoothed motion, and the filtered loads. Differences therefore come from the methods, not from the data.
"""

from collections.abc import Mapping
from contextlib import chdir
from pathlib import Path
from typing import NamedTuple

import numpy as np
import opensim

from hric_bags.export.opensim_text import write_trc
from hric_bags.export.solving import run_tool
from hric_core.geometry import FloatArray
from hric_core.trial.opensim_text import read_storage
from hric_motion.measured import bridged
from hric_motion.moments import JointMoments, longest_known
from hric_motion.plug_in_gait import defined_angles
from hric_motion.trial import TrialMotion
from hric_motion.vendor import compared
from hric_report.trial.opensim_files import (
    MODEL,
    MOMENTS,
    R_GROUND_LAB,
    ROOT_COORDINATES,
    SETUP,
    root_angles,
    write_dynamics,
    write_model,
)

KINEMATICS, DYNAMICS, VENDOR = "OpenSim inverse kinematics", "OpenSim inverse dynamics", "laboratory's software"
DEFINED = f"{VENDOR}, angles by its definitions"
MARKED, SEEN, SOLVED = "human_with_markers.osim", "markers.trc", "inverse_kinematics.mot"


class OpenSimDifference(NamedTuple):
    """Difference of an angle or moment from that of another program, in frames in which both are known.

    Attributes:
        program: name of the other program.
        joint: name of the joint.
        unit: unit of the values: deg or N m.
        frames: number of frames in which both are known.
        rms: root mean square of the difference, in `unit`.
        varying: root mean square of the difference minus its mean, in `unit`.
        peak: largest magnitude of this project's value, in `unit`.
    """

    program: str
    joint: str
    unit: str
    frames: int
    rms: float
    varying: float
    peak: float


def differences(result: TrialMotion, moments: JointMoments | None, folder: Path) -> list[OpenSimDifference]:
    """Return the differences of a trial, one for each program and joint.

    Args:
        result: motion in the trial.
        moments: joint moments; None: not known, so that only angles are compared.
        folder: existing folder for OpenSim's files.

    Raises:
        HricError: OpenSim's tools fail, or the pose of the person is known in too few frames.
    """
    joints, q = list(result.motion.body.joints), result.motion.q
    defined = defined_angles(result.motion, result.trial.subject)
    found = [
        OpenSimDifference(program, one.joint, "deg", one.frames, *map(float, np.degrees([one.rms, one.varying, peak])))
        for program, own in ((VENDOR, dict(zip(joints, q.T, strict=True))), (DEFINED, defined))
        for one in compared(own, result.trial.angles)
        for peak in [np.nanmax(np.abs(own[one.joint]))]
    ]
    write_model(folder, result.motion.body)
    rows = longest_known(result.motion)
    theirs = inverse_kinematics(result, rows, folder)
    found += _compared(KINEMATICS, "deg", joints, np.degrees(q[rows]), {k: np.degrees(v) for k, v in theirs.items()})
    if moments is not None:
        found += _compared(DYNAMICS, "N m", joints, moments.moment, inverse_dynamics(moments, folder))
    return found


def inverse_kinematics(result: TrialMotion, rows: slice, folder: Path) -> dict[str, FloatArray]:
    """Return the joint angles by OpenSim's inverse kinematics, whose markers have equal weights, shape (n,) each [rad].

    Args:
        result: motion of the person; OpenSim's solver starts at its first pose.
        rows: range of frames in which the pose is known.
        folder: folder with the model of the fitted body.
    """
    motion, time = result.motion, result.time[rows]
    positions = bridged(result.positions, result.trial.rate)[rows] @ R_GROUND_LAB.T
    write_trc(folder / SEEN, time, dict(zip(motion.names, positions.swapaxes(0, 1), strict=True)), SEEN)
    model = opensim.Model(str(folder / MODEL))
    tool, tasks = opensim.InverseKinematicsTool(), opensim.IKTaskSet()
    for name in motion.names:
        marker = motion.body.markers[name]
        p_link_marker = opensim.Vec3(*map(float, marker.p_link_marker))
        model.addMarker(opensim.Marker(name, model.getBodySet().get(marker.link), p_link_marker))
        task = opensim.IKMarkerTask()
        task.setName(name)
        task.setWeight(1.0)
        tasks.cloneAndAppend(task)
    names = [*(name for name, _, _ in ROOT_COORDINATES), *motion.body.joints]
    start = np.hstack([motion.root[:, :3], root_angles(motion.root[:, 3:]), motion.q])[rows.start]
    for name, value in zip(names, start, strict=True):
        model.updCoordinateSet().get(name).setDefaultValue(float(np.nan_to_num(value)))
    model.finalizeConnections()
    model.printToXML(str(folder / MARKED))
    tool.set_model_file(str(folder / MARKED))
    tool.set_IKTaskSet(tasks)
    tool.setMarkerDataFileName(str(folder / SEEN))
    tool.setStartTime(float(time[0]))
    tool.setEndTime(float(time[-1]))
    tool.setResultsDir(str(folder))
    tool.setOutputMotionFileName(str(folder / SOLVED))
    tool.set_report_errors(False)
    run_tool(tool, folder / SOLVED, "inverse kinematics")
    solved = read_storage(folder / SOLVED)
    scale = np.pi / 180.0 if solved.degrees else 1.0
    return {name: scale * np.interp(time, solved.time, solved.columns[name]) for name in motion.body.joints}


def inverse_dynamics(moments: JointMoments, folder: Path) -> dict[str, FloatArray]:
    """Return the joint moments by OpenSim's inverse dynamics, by joint, shape (n,) each [N m].

    Args:
        moments: joint moments with motion and loads.
        folder: folder with the model of the fitted body.
    """
    write_dynamics(folder, moments)
    with chdir(folder):  # the set-up names its files relative to itself
        run_tool(opensim.InverseDynamicsTool(SETUP), folder.absolute() / MOMENTS, "inverse dynamics")
    solved = read_storage(folder / MOMENTS)
    time = moments.motion.time
    return {name: np.interp(time, solved.time, solved.columns[f"{name}_moment"]) for name in moments.body.joints}


def _compared(
    program: str, unit: str, joints: list[str], ours: FloatArray, theirs: Mapping[str, FloatArray]
) -> list[OpenSimDifference]:
    """Return the differences of those joints that both programs know in some frames.

    Args:
        program: name of the other program.
        unit: unit of the values.
        joints: names of the j joints.
        ours: values of this project, shape (n, j).
        theirs: values of the other program by joint, shape (n,) each.
    """
    found = []
    for joint, column in zip(joints, ours.T, strict=True):
        known = np.isfinite(column)
        if known.any():
            off = (column - theirs[joint])[known]
            rms, peak = float(np.sqrt(np.mean(off**2))), float(np.abs(column[known]).max())
            found.append(OpenSimDifference(program, joint, unit, int(known.sum()), rms, float(off.std()), peak))
    return found
