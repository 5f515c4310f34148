"""Content of a run folder that a replay needs, and check of a running master before a replay."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hric_bags.parts import PartsReader, parts
from hric_bags.run_folder import RunFolder, runs_root
from hric_core.errors import HricError

NOT_PLAYED = ("/clock", "/rosout", "/rosout_agg")
"""Topics that are not played: the player publishes the clock, and the old log would be mixed with the present one."""
LISTENING = ("/rosout",)
"""Nodes that run with every master."""


@dataclass(frozen=True)
class Run:
    """Recorded run to play.

    Attributes:
        name: name of the run folder.
        bags: parts of the bag, in order.
        urdf: description of the robot as URDF; empty: unknown.
        namespace: namespace of the robot, without a slash at its end; "" for none.
        topics: topics to play.
        has_transforms: True if the bag contains the transforms of a robot_state_publisher.
        duration: time from the first message to the last [s].
    """

    name: str
    bags: list[Path]
    urdf: str
    namespace: str
    topics: list[str]
    has_transforms: bool
    duration: float


def find(name: str, root: str | None) -> Run:
    """Return the run of a name, path or `latest`, below the folder `root` of all runs.

    Raises:
        HricError: the run does not exist, or its bag was not closed, is damaged or is empty.
    """
    folder = RunFolder.open(name, runs_root(root))
    bag = folder.bag_of(folder.read())
    if not bag.is_file():
        unfinished = bag.with_name(bag.name + ".active").is_file()
        hint = (
            f"its recording did not end properly, try: hric health --salvage {folder.path}"
            if unfinished
            else "it was moved away"
        )
        raise HricError(f"the run {folder.path.name} has no bag {bag.name}: {hint}")
    try:
        with PartsReader(bag) as reader:
            topics = sorted(set(reader.topics) - set(NOT_PLAYED)) if reader.message_count else []
            senders = [str(getattr(c.ext, "callerid", "")) for c in reader.connections if c.topic.endswith("/tf")]
            duration = reader.duration * 1e-9 if topics else 0.0
    except OSError as error:
        raise HricError(f"cannot read {bag.name}: {error.strerror or error}") from error
    if not topics:
        raise HricError(f"the run {folder.path.name} has nothing to play: {bag.name} contains no message")
    urdf = folder.urdf_path.read_text() if folder.urdf_path.is_file() else ""
    transforms = any(sender.endswith("/robot_state_publisher") for sender in senders)
    return Run(folder.path.name, parts(bag), urdf, _namespace(topics), topics, transforms, duration)


def _namespace(topics: list[str]) -> str:
    """Return the namespace of the robot's topics."""
    for name in ("/control_log", "/joint_states"):
        for topic in topics:
            if topic.endswith(name):
                return topic.removesuffix(name)
    return ""


def blocked(state: tuple[int, str, Any] | None, run: Run) -> str:
    """Return the reason why a run must not be played on a running master; empty: it may be played.

    A robot on this master would execute the recorded commands.

    Args:
        state: response of the master to getSystemState.
        run: run to play.
    """
    if state is None:
        return ""
    publishers, _, services = state[2]
    for service, nodes in services:
        if service.endswith("controller_manager/switch_controller"):
            return f"a robot runs ({', '.join(nodes)})"
    for topic, nodes in publishers:
        others = [node for node in nodes if node not in LISTENING]
        if others and (topic == "/clock" or topic in run.topics):
            return f"{', '.join(others)} publishes {topic}"
    return ""
