"""Inverse kinematics of a free body by OpenSim from mocap markers, compared with the poses that Motive streamed."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import opensim
from scipy.spatial.transform import Rotation

from hric_bags.export import frames, opensim_formats, recording
from hric_bags.export.opensim_formats import MOCAP_TYPE, RIGID_BODIES, OpenSimMarkers
from hric_bags.export.opensim_text import marker_name
from hric_bags.export.recording import ExportSource
from hric_bags.export.solving import SolveError, exported, load_model, only, output_folder, run_tool
from hric_bags.export.table import FloatArray, TopicTable
from hric_core.trial.opensim_text import read_storage

MIN_MARKERS = 3
ACCURACY = 1e-9
"""Accuracy of the tool's optimiser [1]; the tool's default, 1e-5, leaves errors of some hundredths of a degree."""
COORDINATES = ("rx", "ry", "rz", "tx", "ty", "tz")


@dataclass(frozen=True)
class InverseKinematics:
    """Result of the inverse kinematics.

    Attributes:
        body: name of the body in the mocap stream.
        motion: .mot file with rotations, body-fixed x-y-z [deg], and translations [m] in OpenSim's ground.
        model: OpenSim model of the free body with its markers.
        frames: number of frames solved.
        partial: number of frames with fewer than MIN_MARKERS visible markers, so that several poses fit; the solution
            is one near the pose of the frame before.
        markers: number of markers of the body.
        residual: root mean square distance between markers and model [m].
        position_error, angle_error: differences from the streamed pose in all other frames in which the body is
            tracked, shape (k,) [m], [rad].
    """

    body: str
    motion: Path
    model: Path
    frames: int
    partial: int
    markers: int
    residual: float
    position_error: FloatArray
    angle_error: FloatArray


def solve(source: ExportSource, topic: str = "", body: str = "", output: Path | None = None) -> InverseKinematics:
    """Compute the inverse kinematics: export the markers, create the model, run OpenSim's tool.

    Args:
        source: run or bag with motion capture.
        topic: topic of the motion capture; empty: the only one.
        body: name of the body; empty: the first with MIN_MARKERS.
        output: output folder; None: inverse_kinematics in the run folder.

    Raises:
        HricError: there is no such topic or body, there are too few markers, or the tool fails.
    """
    tables = recording.read(source, types=(MOCAP_TYPE, frames.STATIC))
    captures = {name: table for name, table in tables.items() if opensim_formats.is_capture(table)}
    table = only(captures, topic, "motion capture")
    markers = opensim_formats.markers_of(table, frames.of_run(source.urdf, tables, source.run))
    body, members = _body(table, markers, body)
    folder = output_folder(source, "inverse_kinematics", output)
    trc = exported(source, "trc", table.topic)
    poses = _stream_poses(table, markers, body)
    points = _in_body(poses, markers, members)
    model, motion = folder / f"{marker_name(body)}.osim", folder / f"{marker_name(body)}.mot"
    _write_model(model, body, points)
    _run(model, trc, motion, markers.time, list(points))
    return _compared(body, model, motion, markers, points, poses)


def _body(table: TopicTable, markers: OpenSimMarkers, requested: str) -> tuple[str, list[str]]:
    """Return the requested body, or the first that suits, and the names of its markers in the stream."""
    of_body: dict[str, list[str]] = {}
    for name in markers.positions:
        of_body.setdefault(name.partition("/")[0], []).append(name)
    tracked = {name.partition(".")[0] for name in table.below(RIGID_BODIES)}
    fit = {name: members for name, members in of_body.items() if name in tracked and len(members) >= MIN_MARKERS}
    if (requested and requested not in fit) or not fit:
        bodies = ", ".join(f"{name} ({len(members)})" for name, members in of_body.items()) or "none"
        raise SolveError(
            f"no body{f' {requested!r}' if requested else ''} with {MIN_MARKERS} labelled markers; bodies and their "
            f"markers: {bodies}"
        )
    body = requested or next(iter(fit))
    return body, fit[body]


def _stream_poses(table: TopicTable, markers: OpenSimMarkers, body: str) -> FloatArray:
    """Return the streamed poses of the body in OpenSim's ground, shape (n, 4, 4); NaN: not tracked."""
    cells = table.below(f"{RIGID_BODIES}.{body}")
    valid = (cells["tracking_valid"] == 1)[markers.rows]
    T = np.full((len(valid), 4, 4), np.nan)
    quaternions = np.column_stack([cells[f"pose.orientation.{axis}"] for axis in "xyzw"])[markers.rows][valid].astype(
        float
    )
    p = np.column_stack([cells[f"pose.position.{axis}"] for axis in "xyz"])[markers.rows][valid]
    if not len(p):
        raise SolveError(f"body {body} was never tracked")
    T[valid] = np.eye(4)
    T[valid, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    T[valid, :3, 3] = p
    return np.asarray(markers.T_ground_frame @ T)


def _in_body(poses: FloatArray, markers: OpenSimMarkers, names: list[str]) -> dict[str, FloatArray]:
    """Return each marker's mean position on the body, over frames with marker and tracked body, shape (3,) [m]."""
    points = {}
    for name in names:
        relative = np.einsum("nji,nj->ni", poses[:, :3, :3], markers.positions[name] - poses[:, :3, 3])
        seen = ~np.isnan(relative).any(axis=1)
        if seen.any():
            points[name] = relative[seen].mean(axis=0)
    if len(points) < MIN_MARKERS:
        raise SolveError(f"only {len(points)} markers were visible while the body was tracked; needed: {MIN_MARKERS}")
    return points


def _write_model(path: Path, body: str, points: dict[str, FloatArray]) -> None:
    model = opensim.Model()
    model.setName(marker_name(body))
    rigid = opensim.Body(marker_name(body), 1.0, opensim.Vec3(0), opensim.Inertia(0.01, 0.01, 0.01))
    joint = opensim.FreeJoint("free", model.getGround(), rigid)
    for k, name in enumerate(COORDINATES):
        joint.upd_coordinates(k).setName(name)
    model.addBody(rigid)
    model.addJoint(joint)
    for name, point in points.items():
        model.addMarker(opensim.Marker(marker_name(name), rigid, opensim.Vec3(*map(float, point))))
    model.finalizeConnections()
    model.printToXML(str(path))


def _run(model_path: Path, trc: Path, motion: Path, time: FloatArray, names: list[str]) -> None:
    model = load_model(model_path)
    tasks = opensim.IKTaskSet()
    for name in names:
        task = opensim.IKMarkerTask()
        task.setName(marker_name(name))
        task.setWeight(1.0)
        tasks.cloneAndAppend(task)
    tool = opensim.InverseKinematicsTool()
    tool.setModel(model)
    tool.set_IKTaskSet(tasks)
    tool.setMarkerDataFileName(str(trc))
    tool.setStartTime(float(time[0]))
    tool.setEndTime(float(time[-1]))
    tool.setOutputMotionFileName(str(motion))
    tool.setResultsDir(str(motion.parent))
    tool.set_report_errors(False)
    tool.set_accuracy(ACCURACY)
    tool.printToXML(str(motion.with_name(f"{motion.stem}_setup.xml")))
    run_tool(tool, motion, "inverse kinematics")


def _compared(
    body: str, model: Path, motion: Path, markers: OpenSimMarkers, points: dict[str, FloatArray], poses: FloatArray
) -> InverseKinematics:
    solved = read_storage(motion)
    time, columns = solved.time, solved.columns
    T = np.tile(np.eye(4), (len(time), 1, 1))
    T[:, :3, :3] = Rotation.from_euler(
        "XYZ", np.column_stack([columns[name] for name in COORDINATES[:3]]), degrees=True
    ).as_matrix()
    T[:, :3, 3] = np.column_stack([columns[name] for name in COORDINATES[3:]])
    rows = (
        np.abs(markers.time[:, None] - time[None, :]).argmin(axis=0)
        if len(time) != len(markers.time)
        else np.arange(len(time))
    )
    stream = poses[rows]
    p = [
        np.einsum("nij,j->ni", T[:, :3, :3], point) + T[:, :3, 3] - markers.positions[name][rows]
        for name, point in points.items()
    ]
    distances = np.linalg.norm(p, axis=2)
    measured = (~np.isnan(distances)).sum(axis=0) >= MIN_MARKERS
    tracked = measured & ~np.isnan(stream[:, 0, 0])
    relative = np.einsum("nji,njk->nik", stream[tracked, :3, :3], T[tracked, :3, :3])
    return InverseKinematics(
        body,
        motion,
        model,
        len(time),
        int((~measured).sum()),
        len(points),
        float(np.sqrt(np.nanmean(distances**2))),
        np.linalg.norm(T[tracked, :3, 3] - stream[tracked, :3, 3], axis=1),
        Rotation.from_matrix(relative).magnitude(),
    )


def render(solution: InverseKinematics) -> str:
    """Return the result of the inverse kinematics as text."""
    if not len(solution.position_error):
        return (
            f"{solution.body}: {solution.frames} frames, none with {MIN_MARKERS} visible markers and a tracked body\n"
            f"motion: {solution.motion}\n"
        )
    p, angle = 1e3 * solution.position_error, np.degrees(solution.angle_error)
    return (
        f"{solution.body}: {solution.frames} frames, {solution.markers} markers, residual "
        f"{1e3 * solution.residual:.3g} mm rms; "
        f"{solution.partial} frames have fewer than {MIN_MARKERS} markers, so that several poses fit\n"
        f"difference from the streamed pose in {len(p)} frames: position {p.max():.3g} mm at most, "
        f"{np.sqrt(np.mean(p**2)):.3g} mm rms; "
        f"angle {angle.max():.3g} deg at most, {np.sqrt(np.mean(angle**2)):.3g} deg rms\n"
        f"motion: {solution.motion}\nmodel: {solution.model}\n"
    )
