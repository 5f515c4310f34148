"""Stopping time and distance of an arm by speed and load, rounded up to the next row of a table.

    table = load(Path("own.yaml"))                 # load() reads that of the emulated arm, config/stops.yaml
    stop = table.stop(speed, load=1.5, perception=0.05)      # for `protective_distance`

The table of the package contains simulated stops of the emulated control box, not of the brake of a real arm.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import yaml

from hric_assessment.findings import NotAssessableError
from hric_assessment.separation.protective import Stop, Values
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.node import REQUIRED
from hric_core.parameters import Settings, choice, listing, number, package_yaml, read_yaml, refused, section, text

SIMULATION, MEASUREMENT = "simulation", "measurement"
KINDS = (SIMULATION, MEASUREMENT)
"""Possible origins of a table of stops."""
NOT_A_BRAKE = "stops of an emulated arm in simulation, not of a real arm's brake"
"""Remark on values that were not measured on a real arm."""


@dataclass(frozen=True)
class StopRow(Settings):
    """Row of a table of stops: time and distance of one stop."""

    speed: float = number(above=0.0, unit="m/s", text="speed of the end effector when braking begins")
    load: float = number(0.0, minimum=0.0, unit="kg", text="load of the arm")
    time: float = number(above=0.0, maximum=10.0, unit="s", text="time of braking until the end effector is at rest")
    distance: float | None = number(
        None,
        above=0.0,
        unit="m",
        default_text="speed times time",
        text="distance that the end effector covers while braking",
    )


@dataclass(frozen=True)
class StopTable(Settings):
    """Table of an arm's stops by speed and load.

    There is no interpolation: time and distance are those of the next row with at least that speed and load. If a row
    with lower speed and load has a longer time or distance, those values count.
    """

    title: str = text(empty=False, text="title of the table in findings")
    kind: str = choice(*KINDS, default=REQUIRED, text="origin of the values")
    source: str = text(empty=False, text="who or what made the values, when and how")
    command: str | None = text(None, empty=False, text="command that reproduces the file")
    reaction_time: float = number(
        minimum=0.0,
        maximum=5.0,
        unit="s",
        text="time from the request to stop until braking begins, without the perception time",
    )
    stops: tuple[StopRow, ...] = listing(section(StopRow), text="rows, see below")
    robot: str | None = text(None, empty=False, text="name of the robot in its description; none: a Franka arm")

    def check(self, where: str) -> None:
        """Refuse a duplicate pair of speed and load, and a table without rows."""
        if not self.stops:
            raise refused(f"{where}stops", [], "one row or more")
        pairs = [(row.speed, row.load) for row in self.stops]
        for index, pair in enumerate(pairs):
            if pair in pairs[:index]:
                raise refused(f"{where}stops[{index}]", f"{pair[0]:g} m/s with {pair[1]:g} kg", "each pair once")

    @property
    def name(self) -> str:
        """Title of the table in findings, with a remark if it was simulated."""
        return f"{self.title} ({NOT_A_BRAKE})" if self.kind == SIMULATION else self.title

    @property
    def max_load(self) -> float:
        """Largest load of all rows [kg]."""
        return max(row.load for row in self.stops)

    def stop(self, speed: Values, load: float = 0.0, perception: float = 0.0) -> Stop:
        """Return the stop from a speed with a load; time and distance are 0 for an arm at rest.

        Args:
            speed: speed of the end effector, a number or shape (n,) [m/s].
            load: load of the arm [kg].
            perception: time from the person's motion until the request to stop [s].

        Raises:
            NotAssessableError: no row has at least that speed and load.
            HricError: an argument is not a finite number of 0 or more.
        """
        for name, value in (("speed", speed), ("load", load), ("perception", perception)):
            if not np.all(np.isfinite(value) & (np.asarray(value) >= 0.0)):
                raise HricError(f"{name} is {value}; valid: finite numbers of 0 or more")
        speeds, times, distances = self._from(load)
        fastest = float(np.max(speed, initial=0.0))
        if not len(speeds) or fastest > speeds[-1]:
            up_to = f"{speeds[-1]:g} m/s with {load:g} kg" if len(speeds) else f"{self.max_load:g} kg"
            raise NotAssessableError(
                f"{self.title} has no stop from {fastest:.3g} m/s with {load:g} kg, only up to {up_to}; valid: a file "
                "of stops that includes it"
            )
        index = np.searchsorted(speeds, speed)
        moves = np.asarray(speed) > 0.0
        return Stop(
            self.reaction_time + perception, np.where(moves, times[index], 0.0), np.where(moves, distances[index], 0.0)
        )

    def _from(self, load: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return speeds [m/s], times [s] and distances [m] of stops with a load [kg], by speed, shape (k,) each.

        Each row is first raised to the longest time and distance of all rows with at most its speed and load. For each
        speed, the shortest time and distance of rows with at least this speed and load then count.
        """
        rows = np.array([[r.speed, r.load, r.time, _distance(r)] for r in self.stops])
        below = (rows[:, None, 0] >= rows[None, :, 0]) & (rows[:, None, 1] >= rows[None, :, 1])
        worst = np.max(np.where(below[..., None], rows[None, :, 2:], 0.0), axis=1)
        enough = rows[:, 1] >= load
        speeds = np.unique(rows[enough, 0])
        above = enough[None] & (rows[None, :, 0] >= speeds[:, None])
        best = np.min(np.where(above[..., None], worst[None], np.inf), axis=1)
        return speeds, best[:, 0], best[:, 1]


def _distance(row: StopRow) -> float:
    return row.speed * row.time if row.distance is None else row.distance


def load(path: Path | None = None) -> StopTable:
    """Read a table of stops from a user's file, or, without a path, that of the package.

    Raises:
        HricError: the file is invalid; all its mistakes are listed.
    """
    if path is None:
        return StopTable.of(package_yaml(__file__, "stops"), "stops.yaml:")
    return StopTable.of(read_yaml(path), f"{path.name}:")


def as_yaml(table: StopTable) -> str:
    """Return a table of stops as YAML text that `load` reads."""
    content = {key: value for key, value in asdict(table).items() if value is not None}
    stops = content.pop("stops")
    head = yaml.safe_dump(content, sort_keys=False, width=10_000, allow_unicode=True)
    rows = "".join(f"  - {{{_written(row)}}}\n" for row in stops)
    about = f"# Arm that receives the command to stop: {NOT_A_BRAKE}.\n" if table.kind == SIMULATION else ""
    units = "# speed [m/s], load [kg], time of braking until it is at rest [s], distance [m]; reaction_time [s]\n"
    return f"{about}{units}{head}stops:\n{rows}"


def _written(row: Mapping[str, float | None]) -> str:
    return ", ".join(f"{key}: {value:.6g}" for key, value in row.items() if value is not None)
