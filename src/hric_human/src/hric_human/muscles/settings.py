"""The parameters of the muscles that move a body."""

from dataclasses import dataclass

from hric_control.parameters import Settings, number, text


@dataclass(frozen=True)
class MuscleSettings(Settings):
    """The muscles of a body and the law that shares torques out among them."""

    separator = "."
    anatomy: str = text(
        "delft", empty=False, text="`delft`, which comes with the package, or path of a fitted file or an OpenSim model"
    )
    rate: float = number(
        100.0,
        minimum=10.0,
        maximum=1000.0,
        unit="Hz",
        text="of decisions about activations; a whole part of the cycles",
    )
    co_contraction: float = number(0.0, minimum=0.0, maximum=0.5, text="activation of all muscles beyond the least")
    strength: float = number(1.0, above=0.0, maximum=5.0, text="of all muscles, times that of the subject")
