"""Lab Streaming Layer: an inlet that finds its stream again, and outlets of emulations."""

from hric_perception.lsl.driver import lsl_driver
from hric_perception.lsl.inlet import LslReader, Wanted, source_name
from hric_perception.lsl.outlet import LslOutlet
from hric_perception.lsl.session import use_session

__all__ = ["LslOutlet", "LslReader", "Wanted", "lsl_driver", "source_name", "use_session"]
