"""Formats of an export, and its settings."""

from collections.abc import Sequence
from dataclasses import dataclass

from hric_bags.export import loads, opensim_formats
from hric_bags.export.lerobot import episode
from hric_bags.export.trial import c3d_trial, trial_formats
from hric_core import plugins
from hric_core.errors import ParameterError, UnknownNameError
from hric_core.parameters import number, whole

PLAIN = ("npz", "csv", "parquet")
BAGS = ("bag", "mcap", "ros2")
"""Formats that are written message by message, and need no tables."""
RATE = 100
"""Frames per second of a LeRobot data set, if not chosen otherwise [Hz]; project default, unconfirmed."""
LEROBOT = "lerobot"
"""Format with all runs of an export in one data set."""
FORMATS = (*PLAIN, "trc", "mot", "sto", "external_loads", *trial_formats.KINDS, LEROBOT, *BAGS)
NEEDED: dict[str, tuple[str, ...]] = {
    **opensim_formats.NEEDED,
    "external_loads": loads.NEEDED,
    LEROBOT: episode.NEEDED,
    **dict.fromkeys(trial_formats.KINDS, c3d_trial.NEEDED),
}
"""Format -> message types that it is made from; other formats need all types."""


def formats() -> tuple[str, ...]:
    """Return the names of all formats, those of other packages last."""
    return tuple(dict.fromkeys((*FORMATS, *plugins.names(plugins.EXPORT))))


@dataclass(frozen=True)
class ExportRequest:
    """Settings of an export.

    Attributes:
        formats: names of formats, each one of `formats()`.
        topics: topic names; empty: all.
        load_body: body of a model on which the plates' loads act; empty: no set-up file has them.
        surface: height of the plates' surface above their electrical origin [m].
        anonymise: further words that identify the person, for an anonymised export; None: not anonymised.
        rate: frames per second of a LeRobot data set, a whole number [Hz].
    """

    formats: Sequence[str]
    topics: tuple[str, ...] = ()
    load_body: str = ""
    surface: float = 0.0
    anonymise: tuple[str, ...] | None = None
    rate: int = RATE

    def __post_init__(self) -> None:
        for kind in self.formats:
            if kind not in formats():
                raise UnknownNameError("format", kind, formats())
        number(minimum=-0.5, maximum=0.5, unit="m").checked(self.surface, "--surface")
        if self.surface and not {"external_loads", "c3d", "xdf"} & set(self.formats):
            raise ParameterError("--surface has no effect; valid: with --format external_loads, c3d or xdf")
        if self.load_body and "external_loads" not in self.formats:
            raise ParameterError("--load-body has no effect; valid: with --format external_loads")
        if self.rate != RATE and LEROBOT not in self.formats:
            raise ParameterError("--rate has no effect; valid: with --format lerobot")
        whole(minimum=1, unit="Hz").checked(self.rate, "--rate")
