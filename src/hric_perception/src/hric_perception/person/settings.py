"""Parameters of the node `person`."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from hric_core.errors import HricError
from hric_core.geometry import ORIGIN, Vector
from hric_core.geometry.poses import PoseSettings
from hric_core.parameters import Mistakes, Settings, choice, mapping, names, number, numbers, section, text, unknown
from hric_human.body import Body, Subject, describe
from hric_human.participant.settings import SUBJECT
from hric_motion.tracking import BodyCalibration, PersonTracker
from hric_perception.plate.geometry import PLATE_ID

NONE, ROBOT, PLATE = "none", "robot", "plate"
DOMINANT = "dominant"


@dataclass(frozen=True)
class HandForceSettings(PoseSettings):
    """Parameters of the force on the person's hand: its sensor, and that sensor's pose in the markers' frame."""

    xyz: Vector = numbers(
        3, ORIGIN, unit="m", text="position of the robot's base, or of the plate's middle, in the frame of the markers"
    )
    source: str = choice(
        NONE, ROBOT, PLATE, text="source of the force on a hand: the external wrench of the robot, or a plate"
    )
    hand: str = choice(DOMINANT, "right", "left", text="hand on which the force acts")
    id: str = PLATE_ID

    def side(self, subject: Subject) -> str | None:
        """Return the side of the hand on which the force acts; None if it is not measured."""
        if self.source == NONE:
            return None
        return subject.dominant_hand if self.hand == DOMINANT else self.hand


@dataclass(frozen=True)
class PersonSettings(Settings):
    """Parameters of the node `person`: body, markers, calibration and hand force."""

    subject: Subject = SUBJECT
    parts: str = choice("upper_body", "whole_body", text="estimated parts of the body")
    markers: tuple[str, ...] | None = names(
        default=None,
        default_text="all of the body",
        text="markers that the person wears, by the names of Plug-in Gait",
    )
    labels: Mapping[str, str] = mapping(
        text(empty=False), default={}, text="name in the mocap stream by marker, for markers with another name there"
    )
    asset: str = text("", text="asset of the stream (`asset/marker`) that the person's markers belong to; empty: any")
    pose: Mapping[str, float] = mapping(
        number(unit="rad"),
        default={},
        text="angles of the joints that are not zero in the pose for `calibrate`; none: standing "
        "upright, arms hanging, thumbs forward",
    )
    calibration: str = text(
        "", text="YAML file that `calibrate` writes, and that is read at the start if it exists; empty: none"
    )
    force: HandForceSettings = section(HandForceSettings)

    def check(self, where: str) -> None:
        """Check that the body has the named markers and joints, and that the markers suffice. Raises HricError."""
        mistakes, body = Mistakes(), describe(self.person)
        for checked_names, valid, kind, key in (
            (self.markers or (), body.markers, "marker", "markers"),
            (self.labels, body.markers, "marker", "labels"),
            (self.pose, body.joints, "joint", "pose"),
        ):
            for name in checked_names:
                with mistakes.noted():
                    if name not in valid:
                        raise unknown(kind, name, valid, f"{where}{key}")
        mistakes.raise_all()
        PersonTracker(body, self.worn)

    @property
    def person(self) -> Subject:
        """Subject, reduced or extended to the parts of the body that this node estimates."""
        return replace(self.subject, parts=self.parts)

    @property
    def side(self) -> str | None:
        """Side of the hand whose force is measured; None if there is none."""
        return self.force.side(self.subject)

    @property
    def worn(self) -> tuple[str, ...]:
        """Markers that the person wears."""
        return self.markers or tuple(describe(self.person).markers)

    def known(self) -> tuple[Body, bool]:
        """Return the person's body model, and True if it is calibrated to them.

        Raises:
            HricError: the calibration is of another person, or its file is not valid.
        """
        if not self.calibration or not self.path.is_file():
            return describe(self.person), False
        calibration = BodyCalibration.load(self.path)
        if (calibration.subject.code, calibration.subject.parts) != (self.person.code, self.parts):
            raise HricError(
                f"{self.path} is for {calibration.subject.code} ({calibration.subject.parts}); valid: a calibration "
                f"for {self.person.code} ({self.parts})"
            )
        return calibration.body, True

    @property
    def path(self) -> Path:
        """Path of the calibration file."""
        return Path(self.calibration).expanduser()
