"""An export without the person: who he is and when it was recorded is dropped, what is known of his body coarsened.

Signals stay: where markers are, and how large torques and activations are, has the size and strength of a body for who
computes them. `STAYS` says so in each export.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.export.table import Column, Table

NAME = "recording"
"""Of files that are else called after the run or the bag."""
STEPS = {"mass": 10.0, "height": 0.1}
"""To whole multiples of what a measure of the body is rounded [kg], [m]."""
KEPT = ("parts", "posture")
"""Of a subject, as they are."""
SUBJECT, DATES, FILES = "subject", ("started", "finished"), ("calibration", "muscles")
BODY = frozenset(("sex", "dominant_hand", "lengths", "masses", "code", "age", "weight", "human_mass"))
"""Keys that only a body has, dropped wherever they are."""
STRENGTH = ("strength", "clipped", "at_strength", "share_max", "share_mean")
"""What has the strength of his joints, or gives it together with the torque beside it; by the begin of the name."""
REDUCED = ("mass", "ratio")
"""Of a blow's closed form: they give the mass of his arm."""
HIDDEN_TOPICS = ("/rosout", "/rosout_agg", "/diagnostics", "/diagnostics_agg", "/human_description")
"""Texts of programs, with names of machines and files, and the description of his body."""
OLDEST_DATE = 10**17
"""Later times are dates, earlier ones those of a clock that begins with the run [ns]: a day in 1973."""
MOST_TEXTS = 10_000
"""Texts whose result is remembered: names come again in every message; project default, unconfirmed."""
STAYS = (
    "The signals themselves are as recorded: positions of markers, angles, torques, EMG and activations have the size "
    "and the strength of a body for who computes them."
)
_DATES = re.compile(r"\d{4}-\d\d-\d\d(?:[T ]\d\d:?\d\d(?::?\d\d)?(?:\.\d+)?(?:Z|[+-]\d\d:?\d\d)?)?|\d{8}[-_T]\d{4,6}")
_ANONYMOUS_NODE = re.compile(r"_\d+_\d{13}")
"""End of a node's name that has its process and the date of its start."""


class Anonymiser:
    """Takes the person out of what is exported.

    Args:
        run: contents of run.yaml.
        metrics: contents of metrics.json.
        names: further words that name him.
        begin: time of the bag's first recording [ns].
    """

    def __init__(self, run: Mapping[str, Any], metrics: Mapping[str, Any], names: Sequence[str], begin: int) -> None:
        found = {*names, *_names((run, metrics))}
        words = sorted((word for word in found if len(word) > 1), key=len, reverse=True)
        ends = r"(?<![A-Za-z0-9])(?:{})(?![A-Za-z0-9])"
        self._words = re.compile(ends.format("|".join(map(re.escape, words))), re.IGNORECASE) if words else None
        self._begin = begin if begin >= OLDEST_DATE else None
        self._run, self._metrics = run, metrics
        self._done: dict[str, None] = {}
        self._texts: dict[str, str] = {}

    def _note(self, what: str) -> None:
        self._done.setdefault(what)

    @property
    def done(self) -> list[str]:
        """What was dropped or coarsened so far, a line each."""
        return [*self._done, STAYS]

    # -- files of the run ----------------------------------------------------------------------------------------------

    @property
    def run(self) -> dict[str, Any]:
        """run.yaml."""
        kept = {key: value for key, value in self._run.items() if key != "bag"}
        return dict(self._cleaned(kept, ()))

    @property
    def metrics(self) -> dict[str, Any]:
        """metrics.json."""
        return dict(self._cleaned(self._metrics, ()))

    def _cleaned(self, value: Any, path: tuple[str, ...]) -> Any:
        if isinstance(value, Mapping):
            kept = {key: item for key, item in value.items() if self._stays(str(key), item, path)}
            return {
                self.text(str(key)): self._subject(item) if key == SUBJECT else self._cleaned(item, (*path, str(key)))
                for key, item in kept.items()
            }
        if isinstance(value, list | tuple):
            words = [item for item in value if not (path[-1:] == ("arguments",) and self._reveals(item))]
            return [self._cleaned(item, path) for item in words]
        return self.text(value) if isinstance(value, str) else value

    def _stays(self, key: str, value: Any, path: tuple[str, ...]) -> bool:
        """Whether a key of run.yaml or metrics.json stays."""
        why = ""
        if key in DATES:
            why = "dates of the run: dropped"
        elif key in BODY:
            why = "code, sex, dominant hand, age, measured lengths and masses: dropped"
        elif key.startswith(STRENGTH) and ("human" in path or "person" in path or "strength" in key):
            why = "strength, and shares of it: dropped"
        elif key in FILES and isinstance(value, str):
            why = "files of the person: dropped"
        elif key in REDUCED and path[-1:] == ("transient",):
            why = "masses of his body in contacts: dropped"
        if why:
            self._note(why)
        return not why

    def _reveals(self, argument: Any) -> bool:
        """Whether an override is of the person."""
        reveals = bool(re.match(r"(?:human|person|subject)\b", str(argument)))
        if reveals:
            self._note("overrides of the person: dropped")
        return reveals

    def _subject(self, value: Any) -> Any:
        if not isinstance(value, Mapping):
            self._note("name, code or file of the subject: dropped")
            return "dropped"
        found = {key: value[key] for key in KEPT if key in value}
        for key, step in STEPS.items():
            if isinstance(value.get(key), int | float):
                self._note(f"{key} of the subject: to the next {step:g} {'kg' if key == 'mass' else 'm'}")
                found[key] = round(round(value[key] / step) * step, 6)
        self._note("code, sex, dominant hand, age, measured lengths and masses: dropped")
        return found

    # -- what all share ------------------------------------------------------------------------------------------------

    def text(self, text: str) -> str:
        """Without names of the person, dates, and the dates in names of nodes."""
        if (known := self._texts.get(text)) is not None:
            return known
        given = text
        for pattern, to, what in (
            (_ANONYMOUS_NODE, "", "start and process in names of nodes"),
            (self._words, SUBJECT, "names of the subject in texts and file names"),
            (_DATES, "date", "dates in texts and file names"),
        ):
            if pattern is not None:
                text, count = pattern.subn(to, text)
                if count:
                    self._note(f"{what}: dropped")
        if len(self._texts) < MOST_TEXTS:
            self._texts[given] = text
        return text

    def time(self, nanoseconds: int) -> int:
        """A time that is a date, counted from the first recording; others as they are [ns]."""
        if nanoseconds < OLDEST_DATE:
            return nanoseconds
        self._note("dates of recordings and stamps: counted from the first of them")
        self._begin = nanoseconds if self._begin is None else self._begin
        return max(nanoseconds - self._begin, 0)

    def hides(self, topic: str) -> bool:
        """Whether a topic is left out."""
        hides = topic.endswith(HIDDEN_TOPICS)
        if hides:
            self._note("texts of programs, and the description of his body: topics dropped")
        return hides

    # -- tables --------------------------------------------------------------------------------------------------------

    def tables(self, tables: Mapping[str, Table]) -> dict[str, Table]:
        """Those that stay, by topic."""
        made = [self._table(table) for table in tables.values() if not self.hides(table.topic)]
        return {table.topic: table for table in made}

    def _table(self, table: Table) -> Table:
        columns = tuple(self._column(column) for column in table.columns if not self._strong(column.name))
        return replace(
            table,
            topic=self.text(table.topic),
            frame=self.text(table.frame),
            time=_each(lambda seconds: self.time(round(seconds * 1e9)) * 1e-9, table.time, 1e-9),
            stamp=_each(self.time, table.stamp, 1.0),
            columns=columns,
            notes=tuple(map(self.text, table.notes)),
        )

    def _strong(self, column: str) -> bool:
        strong = column.startswith(("strength_share", "at_strength", "clipped"))
        if strong:
            self._note("strength, and shares of it: dropped")
        return strong

    def _column(self, column: Column) -> Column:
        values = column.values
        if values.dtype.kind == "U":
            unique, rows = np.unique(values, return_inverse=True)
            values = np.array([self.text(str(one)) for one in unique])[rows]
        elif column.unit == "s":
            values = _each(lambda seconds: self.time(round(seconds * 1e9)) * 1e-9, values, 1e-9)
        return Column(self.text(column.name), column.unit, values)

    # -- messages ------------------------------------------------------------------------------------------------------

    def message(self, message: Any) -> Any:
        """A message as rosbags reads it."""
        if hasattr(message, "strength_share"):
            self._note("strength, and shares of it: dropped")
            share = np.full(len(message.strength_share), np.nan)
            nothing = {name: np.zeros_like(getattr(message, name)) for name in ("at_strength", "clipped")}
            message = replace(message, strength_share=share, **nothing)
        return self._part(message)

    def _part(self, value: Any) -> Any:
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, list):
            return [self._part(item) for item in value]
        if not is_dataclass(value) or isinstance(value, type):
            return value
        if hasattr(value, "sec") and hasattr(value, "nanosec"):
            seconds, rest = divmod(self.time(int(value.sec) * 1_000_000_000 + int(value.nanosec)), 1_000_000_000)
            return replace(value, sec=seconds, nanosec=rest)
        own = [field.name for field in fields(value) if field.init and field.name != "__msgtype__"]
        return replace(value, **{name: self._part(getattr(value, name)) for name in own})


def _each(made: Callable[[Any], Any], values: npt.NDArray[Any], unit: float) -> npt.NDArray[Any]:
    """Each value, where one of them may be a date; unit: of one nanosecond in them."""
    if not np.any(values >= OLDEST_DATE * unit):
        return values
    return np.array([made(value) if value >= OLDEST_DATE * unit else value for value in values], dtype=values.dtype)


def _names(value: Any) -> set[str]:
    """Words that name the subject, wherever `subject` is a key."""
    if isinstance(value, Mapping):
        found: set[str] = set().union(*(_names(item) for item in value.values()))
        given = value.get(SUBJECT)
        if isinstance(given, str):
            found |= {given, Path(given).stem}
        elif isinstance(given, Mapping):
            found |= {str(given[key]) for key in ("code", "name") if given.get(key)}
        return found
    if isinstance(value, list | tuple):
        return set().union(*map(_names, value))
    return set()
