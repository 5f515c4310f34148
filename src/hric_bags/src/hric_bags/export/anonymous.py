"""Anonymisation of exports: data that are known to be harmless are exported, everything else is left out.

Each key of run.yaml and metrics.json, each message type and each message field with text has a class in
config/privacy.yaml: public, pseudonym or private; anything that is not listed is private. Mass and height of a subject
are rounded.

Signals are not changed: size and strength of a body can be computed from marker positions, torques and activations.
Each export states this by the sentence `STAYS`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from datetime import date
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.interfaces import Connection

from hric_bags.export.templates import Template
from hric_bags.parts import PartsReader
from hric_bags.run_file import RunFile
from hric_core.parameters import package_yaml

NAME = "recording"
"""Name of exported files that, without anonymisation, have the name of the run or bag."""
STEPS = {"mass": 10.0, "height": 0.1}
"""Steps to which mass [kg] and height [m] of a subject are rounded."""
KEPT = ("parts", "posture")
"""Keys of a subject in run.yaml that are exported unchanged."""
SUBJECT = "subject"
PEOPLE = ("human", "person")
"""Sections of run.yaml and metrics.json in which a number may be a measure of a person's body."""
BODY = ("calibration", "muscles")
"""Keys in the sections of `PEOPLE` that contain measures of the body, if they are a file or a list of numbers."""
STRENGTH = ("strength", "clipped", "at_strength", "share_max", "share_mean")
"""Prefixes of keys with the strength of joints, or with a share of it, from which it follows by the torque."""
REDUCED = ("mass", "ratio")
"""Keys of a contact's closed-form impact model that reveal the mass of the person's arm."""
HASHES = ("commit", "state_sha256")
"""Keys whose value may be a hexadecimal hash."""
OLDEST_DATE = 10**17
"""Smallest time [ns] that counts as a date, a day in 1973; smaller times are counted from the start of the run."""
FIRST_DATED_SECOND = OLDEST_DATE // 1_000_000_000
"""Smallest time in seconds that counts as a date [s]."""
DATED = (1e9, 4e9)
"""Range of numbers that count as times since 1970 [s], from 2001 to 2096; also in ms, us and ns."""
LONGEST = 60
"""Longest text that is exported [characters]; project default, unconfirmed."""
TEMPLATES = 4
"""Largest number of templates (see `Template`) for messages of one size on a topic; project default, unconfirmed."""
STAYS = (
    "The signals are unchanged: body size and strength can be computed from markers, angles, torques, EMG and "
    "activations."
)
_ANONYMOUS_NODE = re.compile(r"_\d+_\d{13}")
"""End of an anonymous node's name: its process number and start date."""
_TOKENS = re.compile(r"[A-Za-z]+\d*|\d+")
_PLAIN = re.compile(r"[A-Za-z0-9_ .:/^*()%\[\]-]*")
_VERSION = re.compile(r"\d{1,3}(\.\d{1,3}){0,3}")
_NUMERIC = re.compile(r"[-+0-9.eE, \[\]]+")
_LEFT_OUT = object()
"""Placeholder for a private value, which is left out."""


@dataclass(frozen=True)
class Privacy:
    """Privacy classes of keys, words and message types: what anonymised exports contain, and in which form."""

    public: frozenset[str]
    private: frozenset[str]
    pseudonym: frozenset[str]
    time: frozenset[str]
    packages: frozenset[str]
    types: frozenset[str]


@cache
def privacy() -> Privacy:
    """Return the privacy classes in config/privacy.yaml."""
    return Privacy(**{key: frozenset(str(words).split()) for key, words in package_yaml(__file__, "privacy").items()})


class Anonymiser:
    """Anonymiser that removes what identifies a person from exported files and messages.

    Args:
        run: contents of run.yaml.
        metrics: contents of metrics.json.
        names: further words that identify the person.
        begin: recording time of the first message in the bag [ns].
    """

    def __init__(self, run: RunFile, metrics: Mapping[str, object], names: Sequence[str], begin: int) -> None:
        known = {word.lower() for name in {*names, *_names((run, metrics))} for word in _TOKENS.findall(name)}
        self._public = privacy().public - known - {re.sub(r"\d+$", "", word) for word in known}
        self._pseudonyms: dict[str, str] = {}
        self._known: dict[str, str] = {}  # cache: names recur in every message
        self._begin = begin if begin >= OLDEST_DATE else None
        self._run, self._metrics = run, metrics
        self._done: dict[str, None] = {}
        self._templates: dict[tuple[str, str, int], list[Template | None]] = {}
        """Topic, type and size [B] of messages -> their templates; None in place of one: such messages are decoded."""

    def _note(self, what: str) -> None:
        self._done.setdefault(what)

    @property
    def done(self) -> list[str]:
        """Sentences on what was dropped or changed so far."""
        return [*self._done, STAYS]

    # -- names and times -----------------------------------------------------------------------------------------------

    def name(self, text: str) -> str:
        """Return a name in which each part with words that are not public is replaced by a number, always the same."""
        if (known := self._known.get(text)) is None:
            parts = (part if part in "/:" else self._part(part) for part in re.split(r"([/:])", text) if part)
            known = self._known[text] = "".join(parts)
        return known

    def _part(self, text: str) -> str:
        bare = _ANONYMOUS_NODE.sub("", text)
        if self.is_public(bare):
            return bare
        self._note("names with words that are not of this project: replaced by numbers")
        return self._pseudonyms.setdefault(text, f"name_{len(self._pseudonyms) + 1}")

    def is_public(self, text: str) -> bool:
        """Return True if a text has only public words, and no digits that could be a date."""
        tokens = _TOKENS.findall(text)
        numbers = sum(token.isdigit() for token in tokens)
        return (
            len(text) <= LONGEST
            and bool(_PLAIN.fullmatch(text))
            and numbers <= (1 if numbers < len(tokens) or len(text) < 3 else 0)
            and all(map(self._is_word, tokens))
        )

    def _is_word(self, token: str) -> bool:
        word = token.rstrip("0123456789").lower()
        digits = len(token) - len(word)
        return digits <= 2 if not word else word in self._public and digits <= (1 if len(word) == 1 else 2)

    def time(self, nanoseconds: int) -> int:
        """Return a date [ns since 1970] as time since the first recorded message [ns]; a robot time stays unchanged."""
        if nanoseconds < OLDEST_DATE:
            return nanoseconds
        self._note("dates of recordings and stamps: replaced by the time since the first of them")
        self._begin = nanoseconds if self._begin is None else self._begin
        return max(nanoseconds - self._begin, 0)

    def _seconds(self, value: float) -> float:
        return self.time(round(value * 1e9)) * 1e-9 if DATED[0] < value < DATED[1] else value

    # -- files of the run ----------------------------------------------------------------------------------------------

    @property
    def run(self) -> RunFile:
        """Contents of run.yaml that may be exported."""
        run: RunFile = self._cleaned(self._run, ())
        return run

    @property
    def metrics(self) -> dict[str, object]:
        """Contents of metrics.json that may be exported."""
        return dict(self._cleaned(self._metrics, ()))

    def urdf(self, text: str) -> str:
        """Return a URDF with anonymised names, from which frames are read; the URDF itself is not exported."""
        return re.sub(r'\b(name|link|joint)="([^"]*)"', lambda match: f'{match[1]}="{self.name(match[2])}"', text)

    def _cleaned(self, value: Any, path: tuple[str, ...]) -> Any:
        if isinstance(value, Mapping):
            return self._mapping(value, path)
        if isinstance(value, list | tuple):
            items = [self._argument(item) for item in value] if path[-1:] == ("arguments",) else value
            cleaned = [self._cleaned(item, path) for item in items]
            return [item for item in cleaned if item is not _LEFT_OUT]
        if isinstance(value, str):
            return self._text(value, path)
        if isinstance(value, bool) or value is None:
            return value
        if path[-1:] and path[-1] in privacy().time:
            return self._seconds(float(value))
        if isinstance(value, int | float) and not _is_date(value):
            return value
        self._note("numbers that are dates: dropped")
        return _LEFT_OUT

    def _mapping(self, mapping: Mapping[Any, Any], path: tuple[str, ...]) -> dict[str, object]:
        made: dict[str, object] = {}
        for name, item in mapping.items():
            key = str(name)
            if key == SUBJECT:
                made[key] = self._subject(item)
            elif not (why := self._refusal(key, item, path)):
                value = self._cleaned(item, (*path, key))
                if value is not _LEFT_OUT:
                    made[self.name(key)] = value
            else:
                self._note(why)
        return made

    def _refusal(self, key: str, value: Any, path: tuple[str, ...]) -> str:
        """Return the reason why a key is left out; empty: it is exported."""
        of_person = any(name in path for name in PEOPLE)
        if key in privacy().private:
            return "dates of the run, notes, texts, paths and values that only a body has: dropped"
        if key.startswith(STRENGTH) and (of_person or "strength" in key):
            return "strength, and shares of it: dropped"
        if key in BODY and (of_person or isinstance(value, str)) and not isinstance(value, Mapping):
            return "files and measures of the person: dropped"
        if key in REDUCED and path[-1:] == ("transient",):
            return "masses of the body in contacts: dropped"
        named = path[-1:] and path[-1] in privacy().pseudonym and isinstance(value, Mapping)
        if not self.is_public(key) and not named:
            return "keys without a privacy class: dropped"
        return ""

    def _text(self, text: str, path: tuple[str, ...]) -> Any:
        key = path[-1] if path else ""
        if key in privacy().pseudonym:
            return self.name(text)
        if (
            (key in HASHES and re.fullmatch(r"[0-9a-f]{3,64}", text))
            or (path[:1] == ("versions",) and _VERSION.fullmatch(text))
            or key == "arguments"
            or (self.is_public(text) and not text.startswith("/"))
        ):
            return text
        self._note("texts with words that are not of this project: dropped")
        return _LEFT_OUT

    def _argument(self, argument: Any) -> Any:
        """Return a command-line override if it does not concern a person and its value is a number or public word."""
        key, _, value = str(argument).partition(":=")
        public = self.is_public(key) and (self.is_public(value) or bool(_NUMERIC.fullmatch(value)))
        dated = any(_is_date(float(number)) for number in re.findall(r"\d+(?:\.\d+)?", value))
        if public and not dated and not re.match(r"(?:human|person|subject)\b", key):
            return str(argument)
        self._note("command-line overrides about the person or with texts: dropped")
        return _LEFT_OUT

    def _subject(self, value: Any) -> Any:
        if not isinstance(value, Mapping):
            self._note("name, code or file of the subject: dropped")
            return "dropped"
        public = {key: value[key] for key in KEPT if self.is_public(str(value.get(key, "no key"))) and key in value}
        for key, step in STEPS.items():
            if isinstance(value.get(key), int | float):
                self._note(f"{key} of the subject: rounded to {step:g} {'kg' if key == 'mass' else 'm'}")
                public[key] = round(round(value[key] / step) * step, 6)
        self._note("code, sex, dominant hand, age, measured lengths and masses: dropped")
        return public

    # -- messages ------------------------------------------------------------------------------------------------------

    def hides(self, kind: str) -> bool:
        """Return True if all messages of a type are left out."""
        hides = kind not in privacy().types and kind.partition("/")[0] not in privacy().packages
        if hides:
            self._note("messages of types that may identify a person (texts, pictures, descriptions): topics dropped")
        return hides

    def serialised(self, bag: PartsReader, connection: Connection, raw: bytes) -> bytes:
        """Return a serialised message without what identifies the person. Raises BagError if it cannot be read."""
        kind = connection.msgtype
        templates = self._templates.setdefault((connection.topic, kind, len(raw)), [])
        for template in templates:
            if template and (known := template.cleaned(raw, self.time, FIRST_DATED_SECOND)) is not None:
                return known
        cleaned = bytes(bag.typestore.serialize_ros1(self.message(bag.deserialize(raw, kind)), kind))
        if len(templates) < TEMPLATES:
            made = Template(
                *(bag.typestore, kind, bag.deserialize(raw, kind)),
                self._field,
                lambda field: field.startswith(STRENGTH),
            )
            templates.append(made if made.cleaned(raw, self.time, FIRST_DATED_SECOND) == cleaned else None)
        return cleaned

    def message(self, message: Any) -> Any:
        """Remove what identifies the person from a deserialised message, in place, and return it."""
        message_type: Any = type(message)
        for field in _fields(message_type):
            setattr(message, field, self._value(field, getattr(message, field)))
        return message

    def _value(self, field: str, value: Any) -> Any:
        kind = type(value)
        if kind is float:
            return self._seconds(value)
        if kind is int:
            return self.time(value)
        if kind is np.ndarray:
            return self._array(field, value)
        if kind is str:
            return self._field(field, value)
        if kind is list:
            return [self._value(field, item) for item in value]
        if hasattr(value, "nanosec"):
            return self._stamp(value) if value.sec >= FIRST_DATED_SECOND else value
        return self.message(value) if is_dataclass(value) else value

    def _field(self, field: str, text: str) -> str:
        if field in privacy().pseudonym or not text:
            return self.name(text)
        self._note("texts in messages: emptied")
        return ""

    def _stamp(self, stamp: Any) -> Any:
        seconds, rest = divmod(self.time(int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)), 1_000_000_000)
        return replace(stamp, sec=seconds, nanosec=rest)

    def _array(self, field: str, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        if field.startswith(STRENGTH):
            self._note("strength, and shares of it: dropped")
            return np.full_like(values, np.nan if values.dtype.kind == "f" else 0)
        if values.dtype != np.float64 or not len(values) or not (values > DATED[0]).any():
            return values
        return np.array([self._seconds(float(value)) for value in values])


@cache
def _fields(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.init and field.name != "__msgtype__")


def _is_date(value: float) -> bool:
    """Return True if a number may be a time since 1970, or a day such as 20260314."""
    if any(DATED[0] * unit < value < DATED[1] * unit for unit in (1.0, 1e3, 1e6, 1e9)):
        return True
    try:
        return value == int(value) and bool(date.fromisoformat(str(int(value)))) and 1900_00_00 < value < 2100_00_00
    except (ValueError, OverflowError):
        return False


def _names(value: Any) -> set[str]:
    """Return the words that name the subject, found under any key `subject` of nested data."""
    if isinstance(value, Mapping):
        words: set[str] = set().union(*(_names(item) for item in value.values()))
        subject = value.get(SUBJECT)
        if isinstance(subject, str):
            words |= {subject, Path(subject).stem}
        elif isinstance(subject, Mapping):
            words |= {str(subject[key]) for key in ("code", "name") if subject.get(key)}
        return words
    if isinstance(value, list | tuple):
        return set().union(*map(_names, value))
    return set()
