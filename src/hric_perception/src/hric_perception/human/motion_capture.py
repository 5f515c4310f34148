"""The emulated Motive that sees the hand: from what stands in an experiment file to its settings and scene. No ROS."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hric_control.errors import HricError, ParameterError
from hric_perception.human.hand import Hand
from hric_perception.human.programs import read_program
from hric_perception.human.recorded import is_recorded, read_recorded
from hric_perception.section import Section, Vector
from mocap_natnet.codec import parse
from mocap_natnet.poses import IDENTITY, ORIGIN, UP_AXES, Pose, compose, normalized
from mocap_natnet.server.motive import Motive
from mocap_natnet.server.scene import TRIANGLE, Body, Faults, Scene
from mocap_natnet.server.settings import TRANSPORTS, Settings

STREAM_KEYS = (
    *("rate", "bitstream", "transport", "up_axis", "command_port", "data_port", "latency", "jitter", "loss", "drift"),
    *("noise", "rotation_noise", "marker_noise", "occlusions", "occlusion_rate", "occlusion_length"),
)


@dataclass(frozen=True)
class Seen:
    """The human and who sees him.

    Attributes:
        hand: moves.
        motive: sees it, and what stands still.
        name: of the hand's body.
    """

    hand: Hand
    motive: Motive
    name: str


def see(human: Any, stream: Any, base_from_mocap: Any, seed: int, where: str = "") -> Seen:
    """Build all of it.

    Args:
        human: mapping: the program with its keys, `begin`, `name`, `markers`, `still`.
        stream: mapping: how Motive streams, and what goes wrong.
        base_from_mocap: mapping `xyz`, `xyzw`: the pose of the mocap frame, z up, in the base, in which the program moves; None: the same frame.
        seed: of all that is random.
        where: name of what the mappings stand in, for messages, e.g. "mocap.".

    Raises:
        HricError: a value that cannot be; names the key.
    """
    person, streaming = Section(f"{where}human", human), Section(f"{where}stream", stream)
    name, begin = person.text("name", "hand"), person.number("begin", 0.0, 0.0, 3600.0)
    T_base_mocap = read_pose(Section(f"{where}base_from_mocap", base_from_mocap))
    if is_recorded(person):
        recorded = read_recorded(person, T_base_mocap)
        hand = Hand(recorded, begin)
        bodies = recorded.seen(hand)
    else:
        hand = Hand(read_program(person, seed), begin)
        bodies = [Body(name, _seen_from(inverse(T_base_mocap), hand), 1, _markers(person))]
    bodies += _still(person.section("still"), inverse(T_base_mocap), len(bodies) + 1)
    settings, faults, up = read_stream(streaming, seed)
    known = [body.name for body in bodies]
    for _, _, body in faults.occlusions:
        if body and body not in known:
            raise ParameterError(f"{streaming.where}.occlusions names the body {body!r}; valid: {', '.join(known)}")
    return Seen(hand, Motive(settings, Scene(tuple(bodies), (), faults, up)), name)


def _markers(person: Section) -> tuple[Vector, ...]:
    """Of the hand's body."""
    markers = tuple((x, y, z) for x, y, z in person.rows("markers", 3)) or TRIANGLE
    if len(markers) < 3:
        raise ParameterError(f"{person.where}.markers has {len(markers)} rows; valid: three markers or more make a body")
    return markers


def _seen_from(T_mocap_base: Pose, source: Callable[[float], Pose]) -> Callable[[float], Pose]:
    return lambda time: compose(T_mocap_base, source(time))


def _still(section: Section, T_mocap_base: Pose, first: int) -> list[Body]:
    """Bodies that do not move: name -> [x, y, z] in the base [m]; first: streaming id of the first one."""
    found = []
    for number, name in enumerate(section.content, first):
        pose = compose(T_mocap_base, Pose(section.vector(name, ORIGIN)))
        found.append(Body(name, lambda time, pose=pose: pose, number))  # type: ignore[misc]
    return found


def read_pose(section: Section) -> Pose:
    """`xyz` [m] and `xyzw`, as natnet_client's parameter `base_from_mocap`. Raises HricError."""
    section.only("xyz", "xyzw")
    turn = section.numbers(f"{section.where}.xyzw", section.content.get("xyzw", list(IDENTITY)), (4,))
    if abs(math.hypot(*turn) - 1.0) > 1e-3:
        raise ParameterError(f"{section.where}.xyzw is {turn}; valid: a unit quaternion, x, y, z, w")
    return Pose(section.vector("xyz", ORIGIN), normalized(turn))


def inverse(pose: Pose) -> Pose:
    """T_b_a of T_a_b."""
    x, y, z, w = pose.orientation
    back = Pose(ORIGIN, (-x, -y, -z, w))
    px, py, pz = pose.position
    return compose(back, Pose((-px, -py, -pz)))


def read_stream(section: Section, seed: int) -> tuple[Settings, Faults, str]:
    """(settings, faults, axis that points up). Raises HricError."""
    section.only(*STREAM_KEYS)
    base = Settings()
    try:
        settings = Settings(
            version=parse(section.text("bitstream", "4.1")),
            rate=section.number("rate", base.rate, 1.0, 1000.0),
            transport=section.text("transport", base.transport, TRANSPORTS),
            command_port=section.whole("command_port", base.command_port, 1, 65535),
            data_port=section.whole("data_port", base.data_port, 1, 65535),
            latency=section.number("latency", base.latency, 0.0, 1.0),
            jitter=section.number("jitter", 0.0, 0.0, 1.0),
            loss=section.number("loss", 0.0, 0.0, 1.0),
            drift=section.number("drift", 0.0, -1e5, 1e5),
            seed=seed,
        )
    except HricError as error:
        text = str(error)
        raise ParameterError(text if text.startswith(section.where) else f"{section.where}: {text}") from error
    faults = Faults(
        section.number("noise", 0.0, 0.0, 1.0),
        section.number("rotation_noise", 0.0, 0.0, 1.0),
        section.number("marker_noise", 0.0, 0.0, 1.0),
        _occlusions(section),
        section.number("occlusion_rate", 0.0, 0.0, 100.0),
        section.number("occlusion_length", 0.3, 0.0, 60.0),
        seed,
    )
    return settings, faults, section.text("up_axis", "y", UP_AXES)


def _occlusions(section: Section) -> tuple[tuple[float, float, str], ...]:
    """[begin [s], duration [s]] or with the name of a body besides."""
    found = []
    rows = section.content.get("occlusions") or []
    if not isinstance(rows, list | tuple):
        raise ParameterError(f"{section.where}.occlusions is {rows!r}; valid: a list of [begin, duration] or [begin, duration, body]")
    for index, row in enumerate(rows):
        body = row[2] if isinstance(row, list | tuple) and len(row) == 3 and isinstance(row[2], str) else ""
        begin, duration = section.numbers(f"{section.where}.occlusions[{index}]", row[:2] if body else row, (2,))
        found.append((begin, duration, body))
    return tuple(found)
