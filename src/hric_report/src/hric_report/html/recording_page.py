"""Page of a bag or a c3d file without a run folder: its verdict, and a replay of arm and person."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import Person, people_of
from hric_assessment.verdict.separating import filled
from hric_bags import files
from hric_bags.records.root_record import RootRecord
from hric_report.html import verdict
from hric_report.html.page import Page, render_page, replay_rate
from hric_report.html.scene import Robot, Track, instants, joint_track


def build(given: AssessmentInput, found: Mapping[str, Any]) -> Page:
    """Return the contents of the page.

    Args:
        given: recording.
        found: its verdict, as in verdict.json.
    """
    log, notes, robots = given.recording.log, list[str](), list[Robot]()
    rate = replay_rate(given.recording.end - given.recording.begin, 50)
    if log is not None and given.description:
        time, position = joint_track(log, rate)
        robots.append(Robot("", given.description, log.joint_names, time, position))
    robots += [_person(given, person, rate, notes) for person in people_of(given) if len(person.time)]
    if not robots:
        notes.append("There is no replay: neither an arm with its description nor a person is in the recording.")
    kind = f"a {given.kind} without a run folder"
    return Page(given.name, kind, robots=robots, notes=notes, verdict=verdict.part(found), name=given.name)


def _person(given: AssessmentInput, person: Person, rate: float, notes: list[str]) -> Robot:
    root = person.root or _of_markers(given)
    if root is None:
        notes.append("Where the person was is not known: they are drawn about the origin.")
    elif person.root is None:
        notes.append("The person is drawn in the frame of the markers, whose place in the world is not known.")
    q, unknown = filled(person.q)
    if unknown:
        notes.append(f"Some joints are not known for {100.0 * unknown:.1f} % of the time; there interpolated.")
    shown = instants(person.time, rate)
    one = Robot("", person.body.urdf, person.names, person.time[shown], q[shown])
    if root is not None:
        seen = instants(root.time, rate)
        one.motion = Track("frame", "person", "world", root.time[seen], root.pose[seen])
    return one


def _of_markers(given: AssessmentInput) -> RootRecord | None:
    """Return the tracked root pose in the frame of the markers, at the times at which it is known; None: never."""
    for tracked in given.recording.tracked.values():
        known = np.isfinite(tracked.pose).all(axis=1)
        if known.any():
            return RootRecord(tracked.time[known], tracked.pose[known])
    return None


def write(given: AssessmentInput, found: Mapping[str, Any], target: Path) -> Path:
    """Write the page, overwriting an earlier one.

    Raises:
        HricError: the page cannot be written, or a library of it is not installed.
    """
    files.write_text(target, render_page(build(given, found)))
    return target
