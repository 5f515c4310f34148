"""Parameters of the controllers that follow a marker; meanings and units: INTERFACE.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from franka_hw_interface.limits import franka_limits
from hric_control.errors import HricError, ParameterError
from hric_control.node import Node
from hric_controllers.marker import Believable
from hric_controllers.marker_follower import FollowerConfig
from hric_controllers.parameters import is_number, number
from hric_controllers.retargeting import MotionLimits
from hric_controllers.workspace import Box, FrameRotation, Rows
from panda_description import CartesianLimit

SOURCES = {"mocap": "/hric/perception/mocap", "point": "/mocap/marker", "none": ""}
"""source -> topic of the markers unless another is given."""
THESIS_ROTATION = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
"""R_base_marker of thesis ch. 3.3: a stream with y up, its x along the robot's."""
WORKSPACE = ((-0.85, -0.85, 0.02), (0.85, 0.85, 1.2))
"""Lower and upper corner [m]. Our choice: the arm's reach of 0.855 m (data sheet), and a table at the height of its base."""


@dataclass(frozen=True)
class TrackingSettings:
    """What a tracking controller reads.

    Attributes:
        source, topic, body: where markers come from: kind, topic, name of the rigid body ("": the first of each frame).
        thesis: the thesis's way of motion; else on-line retargeting.
        follower: how the marker is followed.
        translation, rotation: limits, of the three axes together.
        smoothing_time: of the target [s].
        playout_margin: see `Playout` [s].
    """

    source: str
    topic: str
    body: str
    thesis: bool
    follower: FollowerConfig
    translation: MotionLimits
    rotation: MotionLimits
    smoothing_time: float
    playout_margin: float


def read_tracking(node: Node) -> TrackingSettings:
    """The settings.

    Raises:
        ParameterError: one that cannot be; names it and says what would be valid.
    """
    source = one_of(node, "source", tuple(SOURCES))
    thesis = one_of(node, "mode", ("retarget", "thesis")) == "thesis"
    limits = franka_limits().with_margins()
    return TrackingSettings(
        source=source,
        topic=text(node, "target_marker", SOURCES[source]),
        body=text(node, "body", ""),
        thesis=thesis,
        follower=_read_follower(node),
        translation=_read_limits(node, "translation", (0.7, 2.0, 50.0), limits.translation),
        rotation=_read_limits(node, "rotation", (0.5, 4.0, 100.0), limits.rotation),
        smoothing_time=number(node, "smoothing_time", 0.02, minimum=0.0),
        playout_margin=number(node, "playout_margin", 0.015, minimum=0.0),
    )


def _read_follower(node: Node) -> FollowerConfig:
    attitude = one_of(node, "follow", ("position", "pose")) == "pose"
    if attitude and node.param("source", "mocap") == "point":
        raise ParameterError(f"{node.resolve('follow')} is 'pose', but a point has no attitude; valid with source point: position")
    turn = number(node, "largest_turn", 2.5, above=0.0)
    if turn > 3.0:
        raise ParameterError(f"{node.resolve('largest_turn')} is {turn:g}; valid: up to 3, as half a turn has no unique axis")
    return FollowerConfig(
        rotation=_built(node, "frame_rotation", lambda: FrameRotation(_rows(node, "frame_rotation", THESIS_ROTATION))),
        workspace=_built(node, "workspace", lambda: Box(_row(node, "workspace/lower", WORKSPACE[0]), _row(node, "workspace/upper", WORKSPACE[1]))),
        believable=Believable(number(node, "largest_distance", 10.0, above=0.0), number(node, "largest_step", 0.1, above=0.0), attitude),
        lost_after=number(node, "lost_after", 0.1, minimum=0.0),
        catch_up=one_of(node, "on_return", ("reanchor", "catch_up")) == "catch_up",
        follow_attitude=attitude,
        largest_turn=turn,
    )


def _read_limits(node: Node, group: str, defaults: tuple[float, float, float], arm: CartesianLimit) -> MotionLimits:
    """Limits below what the arm takes."""
    values = []
    for name, default in zip(("velocity", "acceleration", "jerk"), defaults, strict=True):
        value, largest = number(node, f"{group}/{name}", default, above=0.0), getattr(arm, name)
        if value > largest:
            where = node.resolve(f"{group}/{name}")
            raise ParameterError(f"{where} is {value:g}; valid: up to {largest:.4g}, the arm's own limit less a margin")
        values.append(value)
    return MotionLimits(*values)


def one_of(node: Node, parameter: str, choices: tuple[str, ...]) -> str:
    """One of some words; the first is the default.

    Raises:
        ParameterError: another.
    """
    value = node.param(parameter, choices[0])
    if value not in choices:
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: {', '.join(choices)}")
    return str(value)


def text(node: Node, parameter: str, default: str) -> str:
    """A string; empty means the default.

    Raises:
        ParameterError: something else.
    """
    value = node.param(parameter, default)
    if not isinstance(value, str):
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: a string")
    return value or default


def _row(node: Node, parameter: str, default: Any) -> tuple[float, float, float]:
    value = node.param(parameter, list(default))
    if not isinstance(value, list | tuple) or len(value) != 3 or not all(map(is_number, value)):
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: three numbers")
    x, y, z = map(float, value)
    return x, y, z


def _rows(node: Node, parameter: str, default: Any) -> Rows:
    value = node.param(parameter, [list(row) for row in default])
    rows = value if isinstance(value, list | tuple) and len(value) == 3 else []
    good = rows and all(isinstance(row, list | tuple) and len(row) == 3 and all(map(is_number, row)) for row in rows)
    if not good:
        raise ParameterError(f"{node.resolve(parameter)} is {value!r}; valid: three rows of three numbers")
    x, y, z = ((float(row[0]), float(row[1]), float(row[2])) for row in rows)
    return x, y, z


def _built(node: Node, parameter: str, build: Any) -> Any:
    try:
        return build()
    except ParameterError:
        raise
    except HricError as error:
        raise ParameterError(f"{node.resolve(parameter)}: {error}") from None
