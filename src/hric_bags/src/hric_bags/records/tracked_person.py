"""Muscle load of a real person, computed after a run from mocap frames and hand forces in its bag. No ROS.

The code is that by which the node `person` of hric_perception computes the load live.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_bags.parts import Bag
from hric_bags.reader import BagError, seconds
from hric_human.body import Body
from hric_human.muscles import Anatomy
from hric_motion.live_load import AWAY, MISSING, LiveLoad, PersonLoad
from hric_motion.tracking import BRIDGED, LOST, PersonTracker
from hric_perception.person.frames import PersonMarkers
from hric_perception.person.hand_force import source_of
from hric_perception.person.settings import PersonSettings

FRAMES = "hric_msgs/msg/MocapData"


@dataclass(frozen=True)
class TrackedMuscleLoad:
    """Muscle load of a tracked person over a run.

    Attributes:
        load: load at all instants.
        body: body model of the person.
        notes: sentences on how the person was tracked, and which data are missing.
    """

    load: PersonLoad
    body: Body
    notes: tuple[str, ...]


def tracked(
    reader: Bag,
    robot_time: Callable[[float], float],
    settings: PersonSettings,
    anatomy: Anatomy,
    strength: float = 1.0,
) -> TrackedMuscleLoad:
    """Compute the muscle load of a real person over a run.

    Args:
        reader: reader of the bag.
        robot_time: function from stamps to robot time [s].
        settings: settings with the person's body and the sensor of the force on the hand.
        anatomy: anatomy of the person's muscles.
        strength: strength factor of the muscles [1].

    Raises:
        HricError: the bag has no frames, or none that show the person; or the calibration cannot be read.
    """
    body, calibrated = settings.known()
    live, tracker = LiveLoad(body, anatomy, settings.side, strength), PersonTracker(body, settings.worn)
    source, rows = source_of(settings.force), PersonMarkers(settings.worn, settings.labels, settings.asset)
    if source is not None:
        for time, message in _messages(reader, robot_time, lambda c: c.topic.endswith(f"/{source.topic}")):
            live.add_force(source.read(time, message))
    frames, residuals = 0, list[float]()
    for time, message in _messages(reader, robot_time, lambda c: c.msgtype == FRAMES):
        frames += 1
        if (estimate := tracker.update(time, rows.positions(message))) is not None:
            live.add(estimate)
            residuals.append(estimate.residual)
    load = live.take()
    if load is None:
        raise BagError(
            f"the bag has {frames} frames of motion capture, and none of them shows the person; needed are some of the "
            f"markers {', '.join(settings.worn)}, at least three of them on the trunk"
        )
    fitted = "fitted to the person in a still pose" if calibrated else "NOT calibrated"
    note = f"motion: {frames} frames, markers {1e3 * np.nanmean(residuals):.1f} mm from those of the body, {fitted}"
    return TrackedMuscleLoad(load, body, (note, _of_force(load, settings), *_of_arms(load)))


def _messages(
    reader: Bag, robot_time: Callable[[float], float], chosen: Callable[[Any], bool]
) -> Iterator[tuple[float, Any]]:
    """Yield robot time [s] and message of each message on the chosen topics."""
    for connection, _, raw in reader.chosen(chosen):
        message = reader.deserialize(raw, connection.msgtype)
        yield robot_time(seconds(message.header.stamp)), message


def _of_force(load: PersonLoad, settings: PersonSettings) -> str:
    if settings.side is None:
        return "external forces: none measured (person.force.source)"
    shares = {state: 100.0 * np.mean(np.array(load.force) == state) for state in (MISSING, AWAY)}
    return (
        f"forces act on: the {settings.side} hand, measured by the {settings.force.source}; too far from the hand for "
        f"{shares[AWAY]:.1f} % of the time, missing for {shares[MISSING]:.1f} %"
    )


def _of_arms(load: PersonLoad) -> list[str]:
    notes = []
    for side, states in load.states.items():
        lost, bridged = (100.0 * np.mean(np.array(states) == state) for state in (LOST, BRIDGED))
        outside = 100.0 * load.load.outside[side].mean()
        notes.append(
            f"{side} arm: lost for {lost:.1f} % of the time, bridged for {bridged:.1f} %, outside the range in "
            f"which muscle paths were fitted, so that its muscles are left out, for {outside:.1f} %"
        )
    return notes
