"""What whoever assesses chooses."""

from dataclasses import dataclass, field

from hric_assessment.contact.limits import Limits
from hric_assessment.separation.protective import Stop
from hric_assessment.separation.stopping import StopTable
from hric_assessment.tables import limit_table, verdict_table
from hric_control.geometry import FloatArray


@dataclass(frozen=True)
class Braking:
    """How the arm stops.

    Attributes:
        stops: by speed and load; None: nothing is known of its braking.
    """

    stops: StopTable | None = None

    def text(self, load: float) -> str:
        """The assumption, or the source; load: that the arm carries [kg]."""
        rules = verdict_table()
        reaction, time = f"{rules['reaction_time']:g} s", f"{rules['stopping_time']:g} s"
        if self.stops is None:
            return (
                f"the arm reacts after {reaction} and stops within {time} from any speed (chosen here; nothing is "
                "known of its braking)"
            )
        return (
            f"{self.stops.name}, with {load:g} kg; perception takes {reaction} (chosen here), the arm reacts "
            f"{self.stops.reaction_time:g} s later"
        )

    def stop(self, speed: FloatArray, load: float) -> Stop:
        """From speeds of the arm, shape (n,) [m/s], with a load [kg].

        Raises:
            NotAssessableError: faster, or with more load, than any stop that is known.
        """
        rules = verdict_table()
        if self.stops is not None:
            return self.stops.stop(speed, load, rules["reaction_time"])
        return Stop(rules["reaction_time"], 0.0 * speed + rules["stopping_time"])


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
