"""The page of one run."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hric_bags import reader as bag_reader
from hric_bags.reader import BagError, RunRecord
from hric_bags.run_folder import COMPLETED, RunFolder
from hric_control.urdf import read
from hric_experiments.analysis import contact_record, metrics, recordings, stability, tracking
from hric_experiments.analysis import run as analysis
from hric_experiments.analysis import tracking_run as tracking_analysis
from hric_experiments.analysis.recordings import Event, Moving, Recordings, Signal
from hric_experiments.analysis.tracking_run import Tracking
from hric_experiments.report import run_figures
from hric_experiments.report.figure import Curve, Figure, FloatArray, Panel
from hric_experiments.report_html import tables
from hric_experiments.report_html.page import Page, replay_rate
from hric_experiments.report_html.scene import Robot, Track, joint_track

WORLDS = ("", "world", "map")
"""Frames taken as the robot's root where the description has no link of that name."""


@dataclass(frozen=True)
class RunData:
    """A run, read.

    Attributes:
        folder: where it lies.
        run: contents of run.yaml.
        values: contents of metrics.json.
        record: its control log and what goes with it.
        followed: how a marker was followed; None: none was.
        found: what else is in the bag.
        description: URDF; "": the run folder has none.
    """

    folder: RunFolder
    run: Mapping[str, Any]
    values: Mapping[str, Any]
    record: RunRecord
    followed: Tracking | None
    found: Recordings
    description: str

    @property
    def moves(self) -> list[metrics.Move]:
        """Its setpoints."""
        return metrics.moves(self.record, analysis.joint_orders(self.run))


def load(folder: RunFolder, values: Mapping[str, Any], *, progress: bool = False) -> RunData:
    """Read a run.

    Args:
        folder: of the run.
        values: its metrics, as `analysis.analyse` returns them.
        progress: show a progress bar.

    Raises:
        HricError: its bag or its description cannot be used.
    """
    run = folder.read()
    bag = analysis.bag_of(folder, run)
    record = bag_reader.read(bag)
    try:
        description = folder.urdf_path.read_text() if folder.urdf_path.is_file() else ""
    except OSError as error:
        raise BagError(f"cannot read {folder.urdf_path.name} of {folder.path.name}: {error.strerror}") from error
    followed = tracking_analysis.analyse(folder, bag, run, record) if description else None
    return RunData(
        folder, run, values, record, followed, recordings.read(bag, record.robot_time, progress=progress), description
    )


def build(data: RunData) -> Page:
    """What the page of a run shows."""
    run, values = data.run, data.values
    notes: list[str] = []
    tolerances = sorted({float(value) for move in values["setpoints"] for value in move["settling_time_max"]})
    return Page(
        title=f"{run.get('experiment', 'run')}",
        subtitle=f"{data.folder.path.name}: {run.get('description', '')}",
        verdicts=verdicts(run, values),
        head=[tables.overview(run, values)],
        figures=[
            *run_figures.robot_figures(data.record, data.moves, run.get("limits") or {}, tolerances),
            *run_figures.tracking_figures(data.followed)[:1],
            *signal_figures(data.found.signals),
        ],
        tables=_tables(data),
        robots=[robot(data, replay_rate(data.record.log.time[-1] - data.record.log.time[0], width(data)), notes)]
        if data.description
        else [],
        notes=notes if data.description else ["The run folder has no robot.urdf: there is no replay."],
    )


def signal_figures(signals: Iterable[Signal]) -> list[Figure]:
    """One figure per topic: channels of a vector in one panel, those of a sensor with many in one each."""
    by_topic: dict[str, list[Panel]] = {}
    for signal in signals:
        curves = [Curve(name, f"s{k}", signal.time, signal.values[:, k]) for k, name in enumerate(signal.channels)]
        together = [Panel(signal.unit, tuple(curves))]
        alone = [Panel(f"{curve.name} {signal.unit}", (curve,)) for curve in curves]
        by_topic.setdefault(signal.topic, []).extend(together if len(curves) <= 3 else alone)
    return [Figure(topic.strip("/").replace("/", "."), topic, "", tuple(panels)) for topic, panels in by_topic.items()]


def verdicts(run: Mapping[str, Any], values: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What a reader wants to know first."""
    status = str(run.get("status", ""))
    found = [("good" if status == COMPLETED else "bad", status)]
    stable = values["stability"]
    if stable["verdict"] is not None:
        found.append(
            (
                "good" if stable["verdict"] == stability.STABLE else "bad",
                ", ".join([stable["verdict"], *list(stable["joints"])[:1]]),
            )
        )
    if values.get("reflexes"):
        found.append(("bad", f"the arm protected itself {len(values['reflexes'])} times"))
    touched = values.get("limits_touched")
    if touched is not None:
        found.append(("bad", "limits acted") if any(touched.values()) else ("good", "no limit acted"))
    missing = values["control_log"]["missing_cycles"]
    found.append(("bad", f"{missing} cycles missing") if missing else ("good", "every cycle recorded"))
    return found


def _tables(data: RunData) -> list[tables.Table]:
    values, run = data.values, data.run
    found = [tables.move_table(move) for move in values["setpoints"]]
    found.append(tables.limits_table(values["joints"], values["limits_touched"] is not None))
    if values.get("contacts"):
        forces = values["contacts"]
        found.append(
            tables.Table(
                "Contact forces", contact_record.HEAD, tuple(contact_record.cells(forces)), contact_record.note(forces)
            )
        )
    if values.get("tracking"):
        # Phases are among the events.
        found.append(
            tables.tree_table(
                "Following the marker [SI units]", {k: v for k, v in values["tracking"].items() if k != "phases"}
            )
        )
    found += tables.sync_tables(data.found)
    found.append(tables.events_table(events(data)))
    if values.get("differences"):
        rows = tuple((d["what"], str(d["reference"]), str(d["here"]), d["why"]) for d in values["differences"])
        found.append(
            tables.Table(f"Differences from {values['reference']['title']}", ("what", "there", "here", "why"), rows)
        )
    found.append(tables.topics_table(values))
    found.append(tables.tree_table("The experiment as it was run", run.get("definition") or {}, folded=True))
    about = {key: run.get(key) for key in ("parameters", "limits", "versions", "revision", "platform") if run.get(key)}
    found.append(tables.tree_table("Parameters, limits and versions", about, folded=True))
    return found


def events(data: RunData) -> list[Event]:
    """All that happened, in order of time."""
    found = list(data.found.events)
    found += [
        Event(s.time, "setpoint", s.controller, ", ".join(tables.number(float(q)) for q in s.positions) + " rad")
        for s in data.record.setpoints
    ]
    found += [Event(time, "reflex", "arm", ", ".join(names)) for time, names in data.record.reflexes]
    return sorted(found, key=lambda event: event.time)


def width(data: RunData) -> int:
    """Numbers per instant of a run's replay: joints, markers and frames with their times."""
    return len(data.record.log.joint_names) + sum(int(moving.values.shape[1]) + 2 for moving in data.found.moving)


def robot(
    data: RunData, rate: float, notes: list[str], *, label: str = "", role: str = "", shift: float = 0.0
) -> Robot:
    """The robot of a run for the replay.

    Args:
        data: the run.
        rate: at most so many instants per second.
        notes: gets what a reader must know.
        label, role: as `Robot`.
        shift: is added to all times [s].
    """
    time, position = joint_track(data.record.log, rate)
    links = set(read(data.description).links)
    tracks = [_track(moving, rate, links, data.found.statics, notes, shift) for moving in data.found.moving]
    return Robot(
        label,
        data.description,
        data.record.log.joint_names,
        time + shift,
        position,
        [t for t in tracks if len(t.time)],
        role,
    )


def _track(
    moving: Moving, rate: float, links: set[str], statics: Mapping[str, Any], notes: list[str], shift: float
) -> Track:
    """Thinned to the rate, in the frame of a link where one is known."""
    steps = np.floor((moving.time - moving.time[0]) * rate)
    _, kept = np.unique(steps, return_index=True)
    frame, R, p = _placed(moving.frame_id, links, statics)
    if frame not in links and frame not in WORLDS:
        R, p = Rotation.from_matrix(np.array(tracking.THESIS_ROTATION)), np.zeros(3)
        note = (
            f"Where the frame {moving.frame_id!r} stands is not in the bag: what it holds is drawn about the "
            "robot's root, its y axis upwards."
        )
        if note not in notes:
            notes.append(note)
    values = moving.values[kept].copy()
    values[:, :3] = R.apply(values[:, :3]) + p
    seen = ~np.isnan(values[:, 0])
    if values.shape[1] > 3 and seen.any():
        values[seen, 3:] = (R * Rotation.from_quat(_unit(values[seen, 3:]))).as_quat()
    return Track(moving.kind, moving.name, frame, moving.time[kept] + shift, values)


def _unit(quaternions: FloatArray) -> FloatArray:
    """A message that was not filled in has the quaternion 0, which is no rotation."""
    empty = np.linalg.norm(quaternions, axis=1) < 0.5
    return np.where(empty[:, None], np.array([0.0, 0.0, 0.0, 1.0]), quaternions)


def _placed(frame: str, links: set[str], statics: Mapping[str, Any]) -> tuple[str, Rotation, FloatArray]:
    """The link in which a frame is fixed, and where: (link, rotation, translation); (frame, ...) where none is
    known."""
    name, R, p = frame, Rotation.identity(), np.zeros(3)
    for _ in range(len(statics) + 1):
        if name in links or name not in statics:
            break
        name, xyz, quaternion = statics[name]
        here = Rotation.from_quat(quaternion)
        R, p = here * R, here.apply(p) + np.array(xyz)
    return name, R, p
