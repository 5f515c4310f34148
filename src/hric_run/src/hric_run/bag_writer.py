"""Writer of a ROS bag for runs without ROS; messages are stamped with robot time."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.interfaces import Connection

from hric_bags import files
from hric_bags.chunked_writer import ChunkedWriter
from hric_bags.memory import nanoseconds
from hric_core.message_bytes import message_bytes


class BagWriter:
    """Writer of a ROS bag that is named `<name>.bag.active` until it is complete, as with `rosbag record`.

    To be used in a `with` statement. If the block ends normally or by Ctrl-C, the bag is closed and gets its final
    name. After any other error it is closed but keeps `.active`, as it is not complete.

    Attributes:
        path: final name of the bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._active = path.with_name(path.name + ".active")
        self._writer = ChunkedWriter(self._active)
        with self._errors():
            self._writer.open()
        self._connections: dict[tuple[str, type], Connection] = {}

    def write(self, topic: str, message: Any, time: float) -> int:
        """Add a message.

        Args:
            topic: absolute topic name.
            message: ROS message of any type.
            time: robot time [s].

        Returns:
            The time stored in the bag [ns].

        Raises:
            FileError: the file cannot be written, e.g. as the disk is full.
        """
        kind = type(message)
        connection = self._connections.get((topic, kind)) or self._connect(topic, kind)
        data = message_bytes(message)
        stamp = nanoseconds(time)
        try:  # not `_errors`: a context manager takes longer than all of this
            self._writer.write(connection, stamp, data)
        except OSError as error:
            raise files.cannot_write(self._active, error) from error
        return stamp

    def _connect(self, topic: str, kind: Any) -> Connection:
        package, name = kind._type.split("/")
        made = self._connections[topic, kind] = self._writer.add_connection(
            topic, f"{package}/msg/{name}", msgdef=kind._full_text, md5sum=kind._md5sum
        )
        return made

    def close(self, *, complete: bool = True) -> None:
        """Write the index and close the bag; `complete`: True to give the bag its final name.

        Raises FileError if the file cannot be written."""
        with self._errors():
            self._writer.close()
            if complete and self._active.exists():
                self._active.replace(self.path)

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise files.cannot_write(self._active, error) from error

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(files.FileError) if isinstance(error, files.FileError) else contextlib.nullcontext():
            self.close(complete=kind is None or issubclass(kind, KeyboardInterrupt))
