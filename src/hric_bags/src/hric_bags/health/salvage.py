"""Salvage of a damaged bag: its readable messages are copied to a new bag; the damaged bag is not deleted."""

import contextlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hric_bags import foreign
from hric_bags.chunked_writer import ChunkedWriter
from hric_bags.health.bag_records import BagConnection, BagScan
from hric_core.errors import HricError, failing

ACTIVE, DAMAGED = ".active", ".damaged"
REPAIR = "`mcap recover` or `ros2 bag reindex`"
"""Commands of others that repair a bag of ROS 2."""


class SalvageError(HricError):
    """Error for a bag that cannot be salvaged at present."""


@dataclass(frozen=True)
class Salvaged:
    """Result of a salvage: a complete bag made from a damaged one.

    Attributes:
        bag: path of the complete bag.
        original: path of the damaged bag after the salvage.
        messages: number of messages in the complete bag.
        doubtful: sentences on messages that may have wrong values.
    """

    bag: Path
    original: Path
    messages: int
    doubtful: list[str]


def salvage(path: Path) -> Salvaged:
    """Copy the readable messages of a damaged bag to a new bag, which gets the name of a complete recording.

    `x.bag.active` is copied to `x.bag`, and both remain; a damaged `x.bag` is first renamed to `x.bag.damaged`.

    Raises:
        SalvageError: a process still writes the bag, a file of the new name exists, or writing failed.
    """
    if foreign.is_ros2(path):
        raise SalvageError(f"--salvage is for bags of ROS 1, and {path.name} is one of ROS 2; {REPAIR} repairs it")
    if in_use(path):
        raise SalvageError(f"{path.name} is being written by a recorder; end the recording first")
    active = path.name.endswith(ACTIVE)
    target = path.with_name(path.name.removesuffix(ACTIVE))
    original = path if active else path.with_name(path.name + DAMAGED)
    taken = target if active else original
    if taken.exists():
        raise SalvageError(f"{taken.name} exists already; move it away first")
    temporary = path.with_name(f".{target.name}.{os.getpid()}.tmp")
    scan = BagScan(path)
    try:
        messages = _copy(scan, temporary)
        if not active:
            path.rename(original)
        temporary.rename(target)
    except OSError as error:
        with failing():
            raise SalvageError(f"cannot salvage {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
    return Salvaged(target, original, messages, scan.doubtful)


def _copy(scan: BagScan, target: Path) -> int:
    connections: dict[BagConnection, Any] = {}
    count = 0
    with ChunkedWriter(target) as writer:
        for number, time, raw in scan.messages():
            known = scan.connections.get(number)
            if known is None:
                continue
            if known not in connections:
                connections[known] = _add(writer, known)
            writer.write(connections[known], time, raw)
            count += 1
    with target.open("rb+") as file:
        os.fsync(file.fileno())
    return count


def _add(writer: ChunkedWriter, known: BagConnection) -> Any:
    return writer.add_connection(
        known.topic,
        known.type_name.replace("/", "/msg/"),
        msgdef=known.definition,
        md5sum=known.md5sum,
        callerid=known.caller or None,
        latching=int(known.latching),
    )


def in_use(path: Path) -> bool:
    """Return True if a process of this user on this machine has the file open for writing."""
    target = path.resolve()
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # process has ended, or is another user's
            for descriptor in (process / "fd").iterdir():
                if descriptor.readlink() == target and _is_open_for_writing(process / "fdinfo" / descriptor.name):
                    return True
    return False


def _is_open_for_writing(information: Path) -> bool:
    lines = information.read_text().splitlines()
    flags = next((line.split()[1] for line in lines if line.startswith("flags:")), "0")
    return bool(int(flags, 8) & os.O_ACCMODE)
