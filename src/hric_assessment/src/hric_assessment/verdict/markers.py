"""Motion of a person, computed from body markers in a trial or in motion capture frames of a bag."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags.reader import opened, seconds
from hric_bags.records.one_publisher import RisingStamps
from hric_bags.records.recording import RATE, Columns, Recording, TrackedRoot
from hric_bags.records.rows import Thinning, stamp_of
from hric_core.geometry import FloatArray
from hric_human.body import Body
from hric_motion.tracking import LOST, PersonTracker
from hric_perception.person.frames import PersonMarkers
from hric_perception.person.settings import PersonSettings

FRAMES = "hric_msgs/msg/MocapData"
Frame = tuple[float, FloatArray]
"""Motion capture frame: robot time [s], and positions of the markers, shape (m, 3) [m]."""


def of_trial(path: Path) -> Recording:
    """Read a trial as a recording of its people, whose bodies are fitted to the markers.

    Raises:
        HricError: the file cannot be read, has no known markers, or a body does not fit them.
    """
    from hric_motion.trial import prefixes, trial_motion  # with SciPy, which takes longer to load than all else here

    kinds, people, tracked = dict[str, int](), dict[str, Columns](), dict[str, TrackedRoot]()
    several, notes = prefixes(path), list[str]()
    for prefix in several if len(several) > 1 else (None,):
        result = trial_motion(path, prefix=prefix)
        motion, trial = result.motion, result.trial
        name = path.name if prefix is None else f"{path.name}/{result.prefix}"
        notes += [note if prefix is None else f"{result.prefix}: {note}" for note in result.notes]
        rows = slice(None, None, max(1, round(trial.rate / RATE)))
        time = result.time[rows]
        states = Columns(f"{name}/joint_states", tuple(motion.body.joints), time, motion.q[rows])
        tracked_in = motion.root[rows], motion.residual[rows], True, motion.spread[rows], motion.body
        root = TrackedRoot(f"{name}/tracking", "laboratory", time, *tracked_in)
        kinds[f"{name}: {len(result.labels)} markers of {result.marker_set}"] = len(motion.q)
        people[states.topic], tracked[root.topic] = states, root
    end = trial.start + trial.duration
    return Recording(kinds, frozenset(), trial.start, end, float, None, {}, None, people, tracked, notes=tuple(notes))


def of_frames(bag: Path, signals: Recording, settings: PersonSettings) -> tuple[Columns, TrackedRoot] | None:
    """Return joint angles and root pose from motion capture frames in a bag; None: it lacks the person's markers."""
    body, calibrated = settings.known()
    tracker, rows = PersonTracker(body, settings.worn), PersonMarkers(settings.worn, settings.labels, settings.asset)
    found = dict[str, None]()
    with opened(bag) as reader:

        def frames() -> Iterator[Frame]:
            thinning, clock, newest = Thinning(RATE), RisingStamps(), -np.inf
            for connection, _, raw in reader.chosen(lambda c: c.msgtype == FRAMES):
                clock.note(connection, raw)
                if thinning.due(connection.topic, raw) and stamp_of(raw) > newest:  # the tracker needs them in order
                    message, newest = reader.deserialize(raw, connection.msgtype), stamp_of(raw)
                    found[str(message.header.frame_id).strip("/")] = None
                    yield signals.robot_time(seconds(message.header.stamp)), rows.positions(message)

        states, root = tracked(frames(), tracker, "markers", lambda: " and ".join(found), calibrated)
    return (states, root) if len(states.time) else None


def tracked(
    frames: Iterable[Frame], tracker: PersonTracker, name: str, frame: str | Callable[[], str], calibrated: bool
) -> tuple[Columns, TrackedRoot]:
    """Track a person through motion capture frames; return joint angles and root pose, NaN where they are lost.

    Args:
        frames: frames in order of time.
        tracker: tracker of the person's body.
        name: name of the recording, used as prefix of the topic names.
        frame: frame in which the markers are given, or a function that returns it after the last frame.
        calibrated: True if the body was fitted to the person.
    """
    body: Body = tracker.body
    times, angles, roots, residuals = list[float](), list[FloatArray](), list[list[float]](), list[float]()
    for time, positions in frames:
        estimate = tracker.update(time, positions)
        if estimate is None:
            continue
        times.append(time)
        angles.append(np.where(np.array(estimate.states) == LOST, np.nan, estimate.q))
        nowhere: Any = [np.nan] * 7
        roots.append(nowhere if estimate.root_state == LOST else [*estimate.root.position, *estimate.root.orientation])
        residuals.append(estimate.residual)
    n, time_of = len(times), np.array(times)
    q = np.array(angles).reshape(n, len(body.joints))
    states = Columns(f"{name}/joint_states", tuple(body.joints), time_of, q)
    at = frame if isinstance(frame, str) else frame()
    pose = np.array(roots).reshape(n, 7)
    return states, TrackedRoot(f"{name}/tracking", at, time_of, pose, np.array(residuals), calibrated)
