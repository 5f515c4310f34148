"""Writes what can be read of a damaged bag into a whole one; nothing of the damaged one is deleted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rosbags.rosbag1 import Writer

from hric_control.errors import HricError
from hric_experiments.health.bag_records import BagScan, Connection

ACTIVE, DAMAGED = ".active", ".damaged"
CHUNK = 256 * 1024
"""Size of the chunks of a salvaged bag before compression [B]; our choice."""


class SalvageError(HricError):
    """A bag that cannot be salvaged now."""


@dataclass(frozen=True)
class Salvaged:
    """What came of it.

    Attributes:
        bag: the whole one.
        original: where the damaged one is now.
        messages: how many the whole one has.
    """

    bag: Path
    original: Path
    messages: int


def salvage(path: Path) -> Salvaged:
    """Make a whole bag of a damaged one, with the recorder's name for a bag that is whole.

    `x.bag.active` becomes `x.bag` and stays beside it; a damaged `x.bag` is kept as `x.bag.damaged`.

    Raises:
        SalvageError: a process still writes it, there is a bag of that name already, or the disk refuses.
    """
    if in_use(path):
        raise SalvageError(f"{path.name} is being written by a recorder; end the recording first")
    active = path.name.endswith(ACTIVE)
    target = path.with_name(path.name.removesuffix(ACTIVE))
    original = path if active else path.with_name(path.name + DAMAGED)
    taken = target if active else original
    if taken.exists():
        raise SalvageError(f"{taken.name} is there already; move it away first")
    temporary = path.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        messages = _copy(BagScan(path), temporary)
        if not active:
            path.rename(original)
        temporary.rename(target)
    except OSError as error:
        raise SalvageError(f"cannot salvage {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)
    return Salvaged(target, original, messages)


def _copy(scan: BagScan, target: Path) -> int:
    writer = Writer(target)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    writer.chunk_threshold = CHUNK
    connections: dict[Connection, object] = {}
    count = 0
    with writer:
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


def _add(writer: Writer, known: Connection) -> object:
    return writer.add_connection(
        known.topic,
        known.type_name.replace("/", "/msg/"),
        msgdef=known.definition,
        md5sum=known.md5sum,
        callerid=known.caller or None,
        latching=int(known.latching),
    )


def in_use(path: Path) -> bool:
    """Whether a process of this user on this machine has the file open for writing."""
    return any(_open_for_writing(descriptor, path) for descriptor in _descriptors(path))


def _descriptors(path: Path) -> Iterator[Path]:
    wanted = path.resolve()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            for descriptor in (process / "fd").iterdir():
                if Path(os.readlink(descriptor)) == wanted:
                    yield descriptor
        except OSError:  # ended meanwhile, or another user's
            continue


def _open_for_writing(descriptor: Path, path: Path) -> bool:
    try:
        information = (descriptor.parents[1] / "fdinfo" / descriptor.name).read_text()
    except OSError:
        return False
    flags = next((line.split()[1] for line in information.splitlines() if line.startswith("flags:")), "0")
    return bool(int(flags, 8) & os.O_ACCMODE)
