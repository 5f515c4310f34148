"""Examination of a bag, or of the bag in a run folder, with findings and a report."""

import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tqdm import tqdm

from hric_bags import foreign, text
from hric_bags.health import checks
from hric_bags.health.bag_records import BagConnection, BagScan
from hric_bags.health.checks import HealthFinding
from hric_bags.health.salvage import ACTIVE, REPAIR
from hric_bags.health.streams import SYNCED, StreamGatherer, TopicStream
from hric_bags.indexed import BagError
from hric_bags.ros2 import Ros2Reader
from hric_bags.run_folder import RunFolder, runs_root
from hric_core.errors import HricError

HEALTHY, PROBLEMS, DAMAGED = 0, 3, 4
"""Exit codes of the health command, in addition to those of `hric_core.errors`."""


class HealthError(HricError):
    """Error for something that is neither a run folder nor a bag."""


@dataclass(frozen=True)
class BagHealth:
    """Health of a bag: its topics and findings.

    Attributes:
        path: path of the bag.
        size: file size [B].
        streams: topics of the bag.
        findings: findings, damage first.
    """

    path: Path
    size: int
    streams: list[TopicStream]
    findings: list[HealthFinding]

    @property
    def code(self) -> int:
        """Exit code of the worst finding: HEALTHY, PROBLEMS or DAMAGED; notes do not count."""
        return code_of(self.findings)


def code_of(findings: list[HealthFinding]) -> int:
    """Return the exit code for the worst of some findings; notes do not count."""
    levels = {finding.level for finding in findings}
    return DAMAGED if checks.DAMAGED in levels else PROBLEMS if checks.PROBLEM in levels else HEALTHY


def find(name: str, root: Path | None = None) -> tuple[list[Path], RunFolder | None]:
    """Return the parts of a bag, closed or not, and its run folder, if any.

    Args:
        name: path of a bag or run folder, or name of a run, such as "latest".
        root: folder of all runs.

    Raises:
        HricError: there is no such bag or run.
    """
    path = Path(name).expanduser()
    if path.is_file() or foreign.is_ros2(path):
        return _parts(path), None
    if not (path / "run.yaml").is_file() and (path.name.endswith((".bag", ACTIVE))):
        raise HealthError(foreign.describe(path) or f"no bag {path}")
    folder = RunFolder.open(name, root or runs_root())
    run = folder.read()
    return [
        _part(folder.path / str(bag)) for bag in run.get("bags") or [run.get("bag") or folder.bag_path.name]
    ], folder


def _parts(path: Path) -> list[Path]:
    """Return all parts of a split bag, closed or not, if `path` is its first part; else that bag alone."""
    numbered = re.fullmatch(r"(.+_)0\.bag(\.active)?", path.name)
    parts, names = [path], numbered[1] if numbered is not None else ""
    while names and (
        after := [p for p in (path.with_name(f"{names}{len(parts)}.bag{end}") for end in ("", ACTIVE)) if p.is_file()]
    ):
        parts.append(after[0])
    return parts


def _part(bag: Path) -> Path:
    for candidate in (bag, bag.with_name(bag.name + ACTIVE)):
        if candidate.is_file() or foreign.is_ros2(candidate):
            return candidate
    raise HealthError(f"no bag in {bag.parent}: neither {bag.name} nor {bag.name}{ACTIVE}")


def examine(path: Path, *, progress: bool = False, doubtful: Sequence[str] = ()) -> BagHealth:
    """Examine a bag by reading the complete file.

    Args:
        path: path of the bag.
        progress: True to draw a progress bar.
        doubtful: sentences on messages that may have wrong values, known from before.

    Raises:
        HricError: the file is not a bag, or cannot be read.
    """
    if foreign.is_ros2(path):
        return _examine_ros2(path, progress)
    scan = BagScan(path)
    gatherer = StreamGatherer()
    unknown = 0
    try:
        size = path.stat().st_size
        with tqdm(total=None, unit=" messages", desc=path.name, disable=not progress, leave=False) as bar:
            for number, time, raw in scan.messages():
                connection = scan.connections.get(number)
                if connection is None:
                    unknown += 1
                else:
                    gatherer.add(connection, time, raw)
                bar.update()
    except OSError as error:
        raise HealthError(f"cannot read {path}: {error.strerror or error}") from error
    streams = gatherer.streams()
    findings = checks.of_file(scan) + checks.of_streams(streams)
    findings += [HealthFinding(checks.PROBLEM, "", text) for text in (*scan.doubtful, *doubtful)]
    if unknown:
        findings.insert(0, HealthFinding(checks.DAMAGED, "", f"{unknown} messages belong to unknown topics"))
    return BagHealth(path, size, streams, findings)


def _examine_ros2(path: Path, progress: bool) -> BagHealth:
    """Examine a bag of ROS 2, up to the first damage. Raises BagError if it cannot be opened."""
    gatherer, damage = StreamGatherer(uncounted={SYNCED}), []
    with (
        Ros2Reader(path) as reader,
        tqdm(total=None, unit=" messages", desc=path.name, disable=not progress, leave=False) as bar,
    ):
        known = {
            c.id: BagConnection(
                c.topic, c.msgtype.replace("/msg/", "/"), c.digest, c.msgdef.data, "", bool(c.ext.latching)
            )
            for c in reader.connections
        }
        try:
            for connection, time, raw in reader.messages():
                gatherer.add(known[connection.id], time, raw)
                bar.update()
        except BagError as error:
            damage = [HealthFinding(checks.DAMAGED, "", str(error))]
    streams = gatherer.streams()
    size = sum(part.stat().st_size for part in (path.iterdir() if path.is_dir() else [path]))
    return BagHealth(path, size, streams, damage + checks.of_streams(streams))


def render(health: BagHealth) -> str:
    """Return the report on a bag's health as text."""
    cells = [["topic", "messages", "rate", "period", "from", "to"], ["", "", "Hz", "s", "s", "s"]]
    begin = min((float(stream.recorded.min()) for stream in health.streams if len(stream.recorded)), default=0.0)
    for stream in health.streams:
        first, last = ((float(end) - begin) * 1e-9 for end in (stream.recorded.min(), stream.recorded.max()))
        cells.append(
            [
                stream.topic,
                str(len(stream.recorded)),
                _rounded(stream.rate, 2),
                _rounded(stream.period, 4),
                f"{first:.3f}",
                f"{last:.3f}",
            ]
        )
    head = f"{health.path.name}: {sum(len(stream.recorded) for stream in health.streams)} messages, {health.size} bytes"
    verdict = {
        HEALTHY: "healthy",
        PROBLEMS: "readable, with problems",
        DAMAGED: f"damaged: {REPAIR if foreign.is_ros2(health.path) else '--salvage'} writes what can be read into a "
        "whole bag",
    }
    return (
        "\n\n".join(
            [
                head,
                "\n".join(text.rows(cells, head=2)),
                *(["\n".join(map(str, health.findings))] if health.findings else []),
                verdict[health.code],
            ]
        )
        + "\n"
    )


def to_dict(health: BagHealth) -> dict[str, object]:
    """Return the report on a bag's health as data for JSON, without NaN."""
    topics = {
        stream.topic: {
            "type": stream.type_name,
            "messages": len(stream.recorded),
            "rate": None if math.isnan(stream.rate) else stream.rate,
            "period": None if math.isnan(stream.period) else stream.period,
            "missing": [list(span) for span in stream.missing],
            "repeated": [list(span) for span in stream.repeated],
        }
        for stream in health.streams
    }
    return {
        "bag": health.path.name,
        "size": health.size,
        "exit_code": health.code,
        "topics": topics,
        "findings": [asdict(finding) for finding in health.findings],
    }


def _rounded(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"
