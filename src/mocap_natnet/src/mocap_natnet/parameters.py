"""Parameters of the client node."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from hric_control.errors import ParameterError
from hric_control.node import Node
from mocap_natnet.client import Settings
from mocap_natnet.codec import parse
from mocap_natnet.codec.types import Quaternion, Vector
from mocap_natnet.plausibility import Limits
from mocap_natnet.poses import IDENTITY, ORIGIN, UP_AXES, Pose, normalized

MOCAP_FRAME = "mocap"
"""Name of the frame of the stream."""


@dataclass(frozen=True)
class Preset:
    """Names under which bodies are published; `{}` stands for the body.

    Args:
        pose: topic of the poses.
        child: frame of a body in tf.
        frame: of the stream.
        ground_pose: topic of the poses on the ground, "": none.
    """

    pose: str = "/mocap/{}/pose"
    child: str = "{}"
    frame: str = MOCAP_FRAME
    ground_pose: str = ""


PRESETS = {
    "hric": Preset(),
    "mocap_optitrack": Preset("/{}/pose", "{}/base_link", "world", "/{}/ground_pose"),
    "natnet_ros": Preset("/natnet_ros/rigid_bodies/{}/pose"),
}
"""Ours, and those of the drivers of the same name, so that what was written for them finds its topics."""


@dataclass(frozen=True)
class Publishing:
    """What is published, and how.

    Args:
        body: name of the body whose position is `/mocap/marker`; "": the first of the stream.
        up_axis: that points up in the stream.
        base_frame: everything is published in this frame, "": in that of the stream.
        base_from_mocap: pose of the mocap frame, turned to z up, in the base.
        tf_rate: largest rate of transforms [Hz]; 0: none.
        markers_rate: largest rate of the marker array for rviz [Hz]; 0: none.
        trail_length: how much of the followed body's way rviz shows [s]; 0: none.
        parent_frame: frame of which tf tells where the stream's frame stands in it, while nothing is published in it; "": none, or `base_frame`.
        limits: beyond which a pose counts as lost.
        take: name of recordings; "": Motive's own.
        preset: names of topics and frames.
    """

    body: str = ""
    up_axis: str = "y"
    base_frame: str = ""
    base_from_mocap: Pose = field(default_factory=Pose)
    tf_rate: float = 100.0
    markers_rate: float = 30.0
    trail_length: float = 8.0
    parent_frame: str = ""
    limits: Limits = field(default_factory=Limits)
    take: str = ""
    preset: Preset = field(default_factory=Preset)

    @property
    def frame(self) -> str:
        """That is published in."""
        return self.base_frame or self.preset.frame


def read_settings(node: Node) -> Settings:
    """How to find the server. Raises HricError."""
    rule = Settings()
    wanted = _text(node, "bitstream", "")
    return Settings(
        server=_text(node, "server", rule.server),
        discovery=_text(node, "discovery", rule.discovery),
        local=_text(node, "local", rule.local),
        command_port=_whole(node, "command_port", rule.command_port),
        data_port=_whole(node, "data_port", rule.data_port),
        group=_text(node, "group", rule.group),
        transport=_text(node, "transport", rule.transport),
        bitstream=parse(wanted) if wanted else None,
        nominal_latency=_number(node, "nominal_latency", rule.nominal_latency),
    )


def read_publishing(node: Node) -> Publishing:
    """What to publish. Raises ParameterError."""
    rule = Publishing()
    up = _text(node, "up_axis", rule.up_axis)
    if up not in UP_AXES:
        raise ParameterError(f"{node.resolve('up_axis')} is {up!r}; valid: {', '.join(UP_AXES)}")
    preset = _text(node, "topics", "hric")
    if preset not in PRESETS:
        raise ParameterError(f"{node.resolve('topics')} is {preset!r}; valid: {', '.join(sorted(PRESETS))}")
    limits = Limits(
        _vector(node, "volume/low", rule.limits.low), _vector(node, "volume/high", rule.limits.high), _number(node, "max_speed", rule.limits.speed)
    )
    return Publishing(
        body=_text(node, "body", rule.body),
        up_axis=up,
        base_frame=_text(node, "base_frame", rule.base_frame),
        base_from_mocap=Pose(_vector(node, "base_from_mocap/xyz", ORIGIN), _quaternion(node, "base_from_mocap/xyzw")),
        tf_rate=_number(node, "tf_rate", rule.tf_rate),
        markers_rate=_number(node, "markers_rate", rule.markers_rate),
        trail_length=_number(node, "trail_length", rule.trail_length),
        parent_frame=_text(node, "parent_frame", rule.parent_frame),
        limits=limits,
        take=_text(node, "take", rule.take),
        preset=PRESETS[preset],
    )


def _text(node: Node, name: str, default: str) -> str:
    value = node.param(name, default)
    if isinstance(value, int | float) and not isinstance(value, bool):  # 4.1 in YAML is a number
        value = str(value)
    if not isinstance(value, str):
        raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: a text")
    return value


def _whole(node: Node, name: str, default: int) -> int:
    value = node.param(name, default)
    if not isinstance(value, int) or isinstance(value, bool):
        raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: a whole number")
    return value


def _number(node: Node, name: str, default: float) -> float:
    value = node.param(name, default)
    if not _is_number(value) or value < 0:
        raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: a number, 0 or more")
    return float(value)


def _vector(node: Node, name: str, default: Vector) -> Vector:
    value = node.param(name, list(default))
    if not isinstance(value, list | tuple) or len(value) != 3 or not all(map(_is_number, value)):
        raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: three numbers [m]")
    return float(value[0]), float(value[1]), float(value[2])


def _quaternion(node: Node, name: str) -> Quaternion:
    value = node.param(name, list(IDENTITY))
    good = isinstance(value, list | tuple) and len(value) == 4 and all(map(_is_number, value))
    if not good or abs(math.hypot(*value) - 1.0) > 1e-3:
        raise ParameterError(f"{node.resolve(name)} is {value!r}; valid: a unit quaternion, x, y, z, w")
    return normalized(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
