"""Parameters of the node `natnet_client` for what it publishes."""

from dataclasses import dataclass
from typing import Any

from hric_core.geometry import ORIGIN, UP_AXES, Pose, Vector
from hric_core.geometry.poses import PoseSettings
from hric_core.parameters import Settings, choice, flag, number, numbers, section, text
from mocap_natnet.tracking.validity import Volume

MOCAP_FRAME = "mocap"
"""Name of the tf frame of the mocap stream."""


@dataclass(frozen=True)
class Preset:
    """Naming scheme of topics and frames of rigid bodies; `{}` is replaced by the body's name.

    Args:
        pose: topic of a body's pose.
        child: tf frame of a body.
        frame: tf frame of the stream.
        ground_pose: topic of a body's two-dimensional pose on the ground; "": none.
    """

    pose: str = "mocap/{}/pose"
    child: str = "{}"
    frame: str = MOCAP_FRAME
    ground_pose: str = ""


PRESETS = {
    "hric": Preset(),
    "mocap_optitrack": Preset("{}/pose", "{}/base_link", "world", "{}/ground_pose"),
    "natnet_ros": Preset("natnet_ros/rigid_bodies/{}/pose"),
}
"""Naming schemes by name: of this project, and of other drivers, so that nodes written for these find their topics."""


@dataclass(frozen=True)
class BaseFromMocap(PoseSettings):
    """Parameters of the pose of the mocap frame, turned to z up, in the robot's base."""

    xyz: Vector = numbers(3, ORIGIN, unit="m", text="pose of the mocap frame, turned to z up, in the base")


BODY: Any = text(
    "", figures=True, name="body", text="rigid body that is published on `mocap/marker`; empty: the first of the stream"
)
UP_AXIS: Any = choice(*UP_AXES, name="up_axis", text="axis that points up, as set in Motive")


@dataclass(frozen=True)
class Publishing(Settings):
    """Settings of the published topics and frames."""

    body: str = BODY
    up_axis: str = UP_AXIS
    base_frame: str = text(
        "",
        text="frame in which everything is published; empty: `mocap`, with the axes of the stream",
    )
    base: BaseFromMocap = section(BaseFromMocap, name="base_from_mocap")
    volume: Volume = section(Volume)
    max_speed: float = number(10.0, above=0.0, unit="m/s", text="speed above which a body counts as lost")
    tf_rate: float = number(100.0, minimum=0.0, unit="Hz", text="rate of the transforms on `tf`; 0: none")
    markers_rate: float = number(
        30.0, minimum=0.0, unit="Hz", text="rate of the array of all markers for rviz; 0: none"
    )
    trail_length: float = number(
        8.0, minimum=0.0, unit="s", text="duration of the followed body's trail in rviz; 0: no trail"
    )
    parent_frame: str = text(
        "",
        text="`tf` has the mocap frame at `base_from_mocap` in this frame, while everything is published in `mocap`",
    )
    record: bool = flag(True, text="make Motive record a take with each recorded run")
    topics: str = choice(
        *PRESETS,
        text="names of the pose topics and frames, as those drivers have them: `<body>/pose` and frames `world`, "
        "`<body>/base_link`; `natnet_ros/rigid_bodies/<body>/pose`",
    )
    take: str = text("", figures=True, text="name of takes that `start_recording` starts; empty: Motive's own")

    @property
    def preset(self) -> Preset:
        """Naming scheme of topics and frames that the parameter `topics` selects."""
        return PRESETS[self.topics]

    @property
    def base_from_mocap(self) -> Pose:
        """Pose of the mocap frame, rotated to z up, in the robot's base."""
        return self.base.pose

    @property
    def frame(self) -> str:
        """Name of the tf frame of the published data."""
        return self.base_frame or self.preset.frame
