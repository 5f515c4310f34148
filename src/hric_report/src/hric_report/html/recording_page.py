"""Page of a bag or a c3d file without a run folder: verdict on the person, and replay of arm and person."""

from pathlib import Path

import numpy as np

from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson, people_of
from hric_assessment.verdict.separating import filled
from hric_bags import files
from hric_bags.records.root_record import RootRecord
from hric_report.html import verdict
from hric_report.html.page import Page, render_page, replay_rate
from hric_report.html.scene import SceneRobot, SceneSkin, SceneTrack, instants, joint_track
from hric_report.html.verdict_file import VerdictFile
from hric_skin import fitted


def build(source: AssessmentInput, judged: VerdictFile) -> Page:
    """Return the contents of the page of a recording.

    Args:
        source: recording to show.
        judged: verdict on the recording, as in verdict.json.
    """
    log, notes, robots = source.recording.log, list[str](), list[SceneRobot]()
    rate = replay_rate(source.recording.end - source.recording.begin, 50)
    if log is not None and source.description:
        time, position = joint_track(log, rate)
        robots.append(SceneRobot("", source.description, log.joint_names, time, position))
    robots += [_person(source, person, rate, notes) for person in people_of(source) if len(person.time)]
    if not robots:
        notes.append("There is no replay: the recording has neither an arm with its description nor a person.")
    kind = f"a {source.kind} without a run folder"
    labels = [verdict.label(judged)]
    return Page(source.name, kind, labels, robots=robots, notes=notes, verdict=verdict.part(judged), name=source.name)


def _person(source: AssessmentInput, person: AssessedPerson, rate: float, notes: list[str]) -> SceneRobot:
    root = person.root or _of_markers(source)
    if root is None:
        notes.append("The position of the person is not known: they are drawn at the origin.")
    elif person.root is None:
        notes.append("The person is drawn in the frame of the markers, whose pose in the world is not known.")
    q, unknown = filled(person.q)
    if unknown:
        notes.append(f"Some joint angles are not known for {100.0 * unknown:.1f} % of the time; they are interpolated.")
    shown = instants(person.time, rate)
    skin = SceneSkin.of(fitted(person.body))
    robot = SceneRobot("", person.body.urdf, person.names, person.time[shown], q[shown], skin=skin)
    if root is not None:
        seen = instants(root.time, rate)
        robot.motion = SceneTrack("frame", "person", "world", root.time[seen], root.pose[seen])
    return robot


def _of_markers(source: AssessmentInput) -> RootRecord | None:
    """Return the tracked pose of the person's root in the frame of the markers, when known; None: never known."""
    for tracked in source.recording.tracked.values():
        known = np.isfinite(tracked.pose).all(axis=1)
        if known.any():
            return RootRecord(tracked.time[known], tracked.pose[known])
    return None


def write(source: AssessmentInput, judged: VerdictFile, target: Path) -> Path:
    """Write the page of a recording to `target`, overwriting an earlier page; return its path.

    Raises:
        HricError: the page cannot be written, or a library for it is not installed.
    """
    files.write_text(target, render_page(build(source, judged)))
    return target
