"""Writes the messages of a headless run into a ROS bag, stamped with robot time."""

from pathlib import Path
from types import TracebackType
from typing import Any

import rosbag

from hric_control.robot_time.stamps import to_time


class BagWriter:
    """A bag under `<name>.bag.active` until it is whole, as `rosbag record` does it.

    Use it as a context: a clean end, and the user's Ctrl-C, close the bag and give it its name; after any other error
    it is closed and keeps `.active`, so that nobody takes it for a whole one.

    Attributes:
        path: final name of the bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._active = path.with_name(path.name + ".active")
        self._bag = rosbag.Bag(str(self._active), "w", compression="lz4")

    def write(self, topic: str, message: Any, time: float) -> None:
        """Add a message.

        Args:
            topic: absolute topic name.
            message: any ROS message.
            time: robot time [s].
        """
        self._bag.write(topic, message, to_time(max(time, 0.0)))

    def close(self, *, whole: bool = True) -> None:
        """Write the index; with `whole` the bag gets its final name."""
        self._bag.close()
        if whole and self._active.exists():
            self._active.replace(self.path)

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close(whole=kind is None or issubclass(kind, KeyboardInterrupt))
