"""What whoever assesses chooses."""

from dataclasses import dataclass, field

from hric_assessment.contact.limits import Limits
from hric_assessment.separation.protective import Stop
from hric_assessment.tables import limit_table, verdict_table
from hric_control.geometry import FloatArray


@dataclass(frozen=True)
class Braking:
    """How the arm stops.

    Attributes:
        text: of the assumption, or the source.
    """

    text: str = field(
        default_factory=lambda: (
            f"the arm reacts after {verdict_table()['reaction_time']:g} s and stops within "
            f"{verdict_table()['stopping_time']:g} s from any speed (chosen here; nothing is known of its braking)"
        )
    )

    def stop(self, speed: FloatArray) -> Stop:
        """From speeds of the arm, shape (n,) [m/s]."""
        table = verdict_table()
        return Stop(table["reaction_time"], 0.0 * speed + table["stopping_time"])


@dataclass(frozen=True)
class Choices:
    """Beside the recording.

    Attributes:
        limits: that contacts are held against.
        braking: of the arm.
        contact_area: over which contacts act, the smaller of the robot's and the body's [m^2]; None: not known.
    """

    limits: Limits = field(default_factory=lambda: Limits(limit_table()))
    braking: Braking = field(default_factory=Braking)
    contact_area: float | None = None
