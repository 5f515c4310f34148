"""Parameters of the controllers that follow a marker."""

from dataclasses import dataclass

from franka_hw_interface.limits import franka_limits
from hric_controllers.cartesian.workspace import Box, FrameRotation
from hric_controllers.marker.follower import FollowerConfig
from hric_controllers.marker.motion import MotionLimits
from hric_controllers.marker.sample import SampleValidator
from hric_controllers.parameters import state_rate
from hric_core.parameters import Settings, choice, listing, number, numbers, refused, section, text

SOURCES = {"mocap": "hric/perception/mocap", "point": "mocap/marker", "none": ""}
"""Default topic of the markers in the robot's namespace, by source."""
THESIS_ROTATION = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
"""R_base_marker of thesis ch. 3.3, for markers in a frame whose y axis points up and whose x axis is the robot's x."""


@dataclass(frozen=True)
class Translation(MotionLimits):
    """Limits of the end effector's translation: of the Euclidean norm over its three axes."""

    velocity: float = number(
        0.7, above=0.0, unit="m/s", text="limit of the norm over the three axes; at most that of the arm"
    )
    acceleration: float = number(2.0, above=0.0, unit="m/s^2")
    jerk: float = number(50.0, above=0.0, unit="m/s^3")


@dataclass(frozen=True)
class Rotation(MotionLimits):
    """Limits of the end effector's rotation: of the Euclidean norm over its rotation vector from the start."""

    velocity: float = number(
        0.5, above=0.0, unit="rad/s", text="limit of the rotation vector's rate; at most that of the arm"
    )
    acceleration: float = number(4.0, above=0.0, unit="rad/s^2")
    jerk: float = number(100.0, above=0.0, unit="rad/s^3")


def check_arm_limits(where: str, translation: MotionLimits, rotation: MotionLimits) -> None:
    """Raise an error if a limit is above that of the arm; `where`: namespace of the parameters."""
    arm = franka_limits().with_margins()
    for group, limits, largest in (
        ("translation", translation, arm.translation),
        ("rotation", rotation, arm.rotation),
    ):
        for name in ("velocity", "acceleration", "jerk"):
            value, bound = getattr(limits, name), getattr(largest, name)
            if value > bound:
                raise refused(f"{where}{group}/{name}", value, f"up to {bound:.4g}, the arm's own limit less a margin")


@dataclass(frozen=True)
class Workspace(Box):
    """Workspace of the end effector, with default corners.

    The defaults are unconfirmed: the arm's reach of 0.855 m (data sheet), and a table at the height of its base.
    """

    lower: tuple[float, float, float] = numbers(
        3, (-0.85, -0.85, 0.02), unit="m", text="corner of the end effector's workspace, in `<arm_id>_link0`"
    )
    upper: tuple[float, float, float] = numbers(3, (0.85, 0.85, 1.2), unit="m", text="the other corner")


@dataclass(frozen=True)
class TrackingSettings(Settings):
    """Parameters common to the controllers whose end effector follows a marker or moves to commanded poses."""

    source: str = choice(*SOURCES, text="`mocap`: MocapData, `point`: Point, `none`: commanded poses only")
    target_marker: str = text(
        "",
        default_text="by `source`",
        text="topic of the markers; empty: `hric/perception/mocap` or `mocap/marker` in the robot's namespace; if "
        "several arms are in one world, in their common one",
    )
    body: str = text("", text="name of the rigid body; empty: the first of each frame")
    mode: str = choice(
        "retarget",
        "thesis",
        text="`retarget`: the motion is planned again at each marker; `thesis`: trapezoidal motions in turn, "
        "without a limit of jerk; markers during a motion are ignored",
    )
    follow: str = choice("position", "pose", text="`position`: the orientation is held, `pose`: it turns with the body")
    on_return: str = choice(
        "reanchor", "catch_up", text="of a lost marker: `reanchor`, or `catch_up` with where it is by then"
    )
    frame_rotation: FrameRotation = listing(
        numbers(3),
        3,
        THESIS_ROTATION,
        made=FrameRotation,
        default_text="that of the thesis",
        text="R_base_marker by rows; does not act on markers that come in `<arm_id>_link0`",
    )
    translation: MotionLimits = section(Translation)
    rotation: MotionLimits = section(Rotation)
    smoothing_time: float = number(
        0.02,
        minimum=0.0,
        unit="s",
        text="time constant of the filter of the target; adds as much lag. Without effect in the mode `thesis`",
    )
    playout_margin: float = number(
        0.015,
        minimum=0.0,
        unit="s",
        text="a marker counts at one delay after its stamp, the least of the last 5 s and this; one that "
        "comes so much later, less a period of the stream, does no harm. Adds as much lag. Without "
        "effect on markers without a stamp and in the mode `thesis`",
    )
    lost_after: float = number(0.1, minimum=0.0, unit="s", text="time without a valid marker after which it is lost")
    largest_step: float = number(0.1, above=0.0, unit="m", text="a marker further from the one before is refused")
    largest_distance: float = number(
        10.0, above=0.0, unit="m", text="a marker further from the origin of its frame is refused"
    )
    largest_turn: float = number(
        2.5,
        above=0.0,
        maximum=3.0,
        unit="rad",
        text="largest turn from the orientation at the start; half a turn has no unique axis",
    )
    workspace: Box = section(Workspace)
    state_publish_rate: float = state_rate(100.0)

    def check(self, where: str) -> None:
        """Raise an error if a point's orientation is to be followed, or if a limit is above that of the arm."""
        if self.follow == "pose" and self.source == "point":
            raise refused(f"{where}follow", self.follow, "position with source point: a point has no orientation")
        check_arm_limits(where, self.translation, self.rotation)

    @property
    def topic(self) -> str:
        """Topic of the markers, relative to the robot's namespace; empty for the source `none`."""
        return self.target_marker or SOURCES[self.source]

    @property
    def thesis(self) -> bool:
        """True for motions on straight lines as in the thesis, False for the online trajectory generator."""
        return self.mode == "thesis"

    @property
    def follower(self) -> FollowerConfig:
        """Settings of the marker follower."""
        attitude = self.follow == "pose"
        return FollowerConfig(
            rotation=self.frame_rotation,
            workspace=self.workspace,
            validator=SampleValidator(self.largest_distance, self.largest_step, attitude),
            lost_after=self.lost_after,
            catch_up=self.on_return == "catch_up",
            follow_attitude=attitude,
            largest_turn=self.largest_turn,
        )
