"""Functions that read a bag with the rosbags library, without ROS."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from rosbags.highlevel import AnyReader


def control_log(bag: Path, topic: str = "/control_log") -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]:
    """Return the index and robot time [s] of each logged cycle, in the order of the bag."""
    cycles: list[npt.NDArray[np.int64]] = []
    times: list[npt.NDArray[np.float64]] = []
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages([item for item in reader.connections if item.topic == topic]):
            message = reader.deserialize(raw, connection.msgtype)
            cycles.append(message.first_cycle + np.arange(message.n_cycles))
            times.append(message.time)
    return np.concatenate(cycles), np.concatenate(times)


def gaps_and_repeats(cycles: npt.NDArray[np.int64]) -> tuple[int, int]:
    """Return the number of missing cycles, and of cycles that are repeated or out of order."""
    steps = np.diff(cycles)
    return int(np.sum(steps[steps > 1] - 1)), int(np.sum(steps < 1))


def topics(bag: Path) -> set[str]:
    """Return the topics in the bag."""
    with AnyReader([bag]) as reader:
        return {connection.topic for connection in reader.connections}
