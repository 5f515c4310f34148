"""Poses of the objects in a simulated world over a run. No ROS."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, opened
from hric_bags.records.rows import xyz_quaternion
from hric_control.plants import WindowlessConfig
from hric_control.plants.models import Model, model_of_object
from hric_control.plants.worlds import load_world
from hric_core.errors import HricError

STATES_TYPE = "gazebo_msgs/msg/ModelStates"


@dataclass(frozen=True)
class ObjectRecord:
    """Pose of an object of the simulated world over time.

    Attributes:
        name: name of the object's model.
        description: URDF of the object.
        time: robot time, shape (n,) [s].
        pose: pose of the root link in the world: position [m] and quaternion x y z w, shape (n, 7).
    """

    name: str
    description: str
    time: FloatArray
    pose: FloatArray


def models(plant: Mapping[str, object]) -> list[Model]:
    """Return the models of the objects in a plant's world; empty if the world file does not exist any more.

    Args:
        plant: parameters of the simulated plant, with the world.
    """
    try:
        objects = load_world(str(plant.get("world") or ""), WindowlessConfig().contact_stiffness)
        return [model_of_object(item) for item in objects]
    except (HricError, OSError):
        return []


def read(bag: Path | Bag, plant: Mapping[str, object], robot_time: Callable[[float], float]) -> list[ObjectRecord]:
    """Return the recorded objects of a world, without planes; in live runs, times are those of the recording.

    Args:
        bag: bag of the run.
        plant: parameters of the simulated plant, with the world.
        robot_time: function from a stamp to robot time [s].
    """
    known = {model.name: model for model in models(plant) if not model.planes}
    samples: dict[str, list[list[float]]] = {name: [] for name in known}
    if not known:
        return []
    with opened(bag) as reader:
        for connection, stamp, raw in reader.chosen(lambda c: c.msgtype == STATES_TYPE):
            message, time = reader.deserialize(raw, connection.msgtype), robot_time(1e-9 * stamp)
            for name, pose in zip(message.name, message.pose, strict=True):
                if name in samples:
                    samples[name].append([time, *xyz_quaternion(pose)])
    arrays = {name: np.array(rows) for name, rows in samples.items() if rows}
    return [ObjectRecord(name, known[name].xml, array[:, 0], array[:, 1:]) for name, array in arrays.items()]
