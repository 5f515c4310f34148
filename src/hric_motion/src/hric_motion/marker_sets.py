"""Marker sets of laboratories: which marker of the body each label of a recording is, with or without a prefix.

The sets are the files `marker_sets/*.yaml`, each with its source. Labels are compared without regard to case, dots,
underscores, hyphens and spaces. A prefix ends with a colon, an underscore or a slash.
"""

import difflib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hric_core.errors import ParameterError
from hric_core.parameters import read_yaml
from hric_human.body.markers import ExtraMarker, MarkerRow

FOLDER = Path(__file__).with_name("marker_sets")
FIRST = "plug_in_gait"
"""Set that is preferred if others know as many labels; its patterns of computed points hold for all sets."""
FEW = 4
"""Smallest number of markers of a prefix that counts as a person if there are several prefixes.

The constants of this file are project defaults, unconfirmed."""
LIKENESS = 0.8
"""Smallest similarity (of `difflib`) of a label to a known one for a guess [1]."""
SHORTEST = 2
"""Smallest number of characters of a known label that is guessed since a label contains it."""
SHOWN = 8
"""Largest number of labels that a sentence lists; it counts the others."""
SIDES = (("L", "left"), ("R", "right"))
UNLABELLED = re.compile(r"[*#]?\d+|[*#].*|UNLABEL\w*|UNNAMED\w*|TRAJECTORY\d*|MARKER\d+")
"""Pattern of plain labels (see `plain`) of trajectories that nobody has labelled."""
Person = dict[str, str]
"""Label in the recording by name of the marker, for one person."""


EMG = "emg"
"""Key of a mapping file with the muscles of EMG channels."""


@dataclass(frozen=True)
class TrialMarkerSet:
    """Marker set of a laboratory, a program or a model.

    Attributes:
        name: name of the set.
        source: where its labels and places come from.
        known: name of the marker by plain label, see `plain`.
        extra: markers that the table of the body lacks, by name.
        computed: patterns of plain labels of points that software computes.
        unused: reasons why labels of the set are not used, by plain label.
    """

    name: str
    source: str
    known: Mapping[str, str]
    extra: Mapping[str, ExtraMarker]
    computed: tuple[str, ...]
    unused: Mapping[str, str]

    def people(self, labels: Iterable[str]) -> dict[str, Person]:
        """Return each person's labels by prefix with its separator; of two labels of a marker, the first counts."""
        people: dict[str, Person] = {}
        for label in labels:
            found = self._found(label)
            if found:
                people.setdefault(found[0], {}).setdefault(found[1], label)
        return people

    def matches(self, labels: Iterable[str]) -> int:
        """Return the largest number of this set's markers that the labels with one prefix name."""
        return max(map(len, self.people(labels).values()), default=0)

    def _found(self, label: str) -> tuple[str, str] | None:
        """Return prefix and marker of a label; None: it is not one of the set."""
        for begin in (0, *(match.end() for match in re.finditer("[:_/]", label))):
            marker = self.known.get(plain(label[begin:]))
            if marker:
                return label[:begin], marker
        return None

    def left_out(self, labels: Iterable[str]) -> list[str]:
        """Return one sentence for each kind of labels that are not markers of the set."""
        kinds: dict[str, list[str]] = {}
        for label in labels:
            last = plain(label.split(":")[-1])
            if last in self.unused:
                kind = f"not used, since {self.unused[last]}"
            elif any(re.fullmatch(pattern, last) for pattern in self.computed):
                kind = "computed points"
            else:
                kind = "unlabelled" if UNLABELLED.fullmatch(last) else f"not markers of {self.name}"
            kinds.setdefault(kind, []).append(label)
        return [f"{len(found)} {kind}: {_few(found)}" for kind, found in kinds.items()]


def plain(label: str) -> str:
    """Return a label in capitals without dots, underscores, hyphens and spaces."""
    return re.sub(r"[._\-\s]", "", label).upper()


def _few(labels: Sequence[str]) -> str:
    return ", ".join(labels[:SHOWN]) + (f" and {len(labels) - SHOWN} more" if len(labels) > SHOWN else "")


@cache
def marker_sets() -> dict[str, TrialMarkerSet]:
    """Return the marker sets by the name of their file, Plug-in Gait first."""
    trees = {path.stem: read_yaml(path) for path in sorted(FOLDER.glob("*.yaml"))}
    return {key: _marker_set(trees, key) for key in sorted(trees, key=lambda key: key != FIRST)}


def _marker_set(trees: Mapping[str, Any], key: str) -> TrialMarkerSet:
    tree = trees[key]
    base = trees[tree["base"]]["labels"] if "base" in tree else {}
    known, extra = dict[str, str](), dict[str, ExtraMarker]()
    sides = [(word, *side) for word, side in zip(tree.get("sides", "LR"), SIDES, strict=True)]
    for label, entry in (base | tree["labels"]).items():
        for word, letter, side in sides if "{}" in label else (("", "", ""),):
            name = label.format(word)
            if isinstance(entry, str):
                known[plain(name)] = letter + entry
                continue
            known[plain(name)] = name
            forward, outward, up = map(float, entry["offset"])
            left, right = share if isinstance(share := entry["share"], list) else (share, share)
            row = MarkerRow(name, entry["segment"], (left, right), (forward, outward, up))
            extra[name] = ExtraMarker(name, row, side, entry.get("loose", False))
    computed = (*tree.get("computed", ()), *(trees[FIRST]["computed"] if key != FIRST else ()))
    unused = {plain(label): reason for label, reason in tree.get("unused", {}).items()}
    return TrialMarkerSet(tree["name"], tree["source"], known, extra, computed, unused)


def best_set(labels: Sequence[str]) -> TrialMarkerSet:
    """Return the set that knows the largest number of the labels."""
    return max(marker_sets().values(), key=lambda one: one.matches(labels))


def _all_known() -> dict[str, str]:
    """Return the markers of all sets by plain label; a label in several sets has the marker of the first."""
    sets = tuple(marker_sets().values())
    return {label: marker for one in reversed(sets) for label, marker in one.known.items()}


def mapped_set(path: Path) -> tuple[TrialMarkerSet, Mapping[str, str]]:
    """Read a mapping file, which names the marker of each label (empty: the label is not used).

    Returns:
        the markers as a set, and the label of each marker.

    Raises:
        ParameterError: the file is not a mapping of texts, or names unknown markers or one of them twice.
    """
    tree, known = read_yaml(path), _all_known()
    if not isinstance(tree, Mapping):
        raise ParameterError(f"{path} has no mapping of labels; valid: lines `LABEL: MARKER`")
    used = {str(label): plain(str(marker)) for label, marker in tree.items() if marker and label != EMG}
    unknown = sorted({marker for marker in used.values() if marker not in known})
    if unknown:
        near = {marker: difflib.get_close_matches(marker, known, 1, 0.0)[0] for marker in unknown}
        text = ", ".join(f"{marker} (nearest: {known[other]})" for marker, other in near.items())
        raise ParameterError(f"{path} names unknown markers: {text}; valid: names of Plug-in Gait or of another set")
    labels: Person = {}
    for label, marker in used.items():
        name = known[marker]
        if name in labels:
            raise ParameterError(f"{path} names {name} twice: for {labels[name]} and for {label}; valid: once")
        labels[name] = label
    extra = {name: marker for one in reversed(marker_sets().values()) for name, marker in one.extra.items()}
    return TrialMarkerSet(path.name, str(path), {}, extra, marker_sets()[FIRST].computed, {}), labels


def maps_markers(path: Path) -> bool:
    """Return False if a mapping file names the muscles of EMG channels only. Raises ParameterError."""
    tree = read_yaml(path)
    return not isinstance(tree, Mapping) or set(tree) != {EMG}


def mapping_text(labels: Sequence[str]) -> str:
    """Return the text of a mapping file with all labels, each with its marker, a guess, or nothing."""
    one, known = best_set(labels), _all_known()
    lines = [
        "# LABEL OF THE RECORDING: NAME OF ITS MARKER in Plug-in Gait or another set; empty: the label is not used.",
        f"# Nearest set: {one.name}, {one.matches(labels)} of {len(labels)} labels. Check each line, also each guess.",
    ]
    taken = {marker for person in one.people(labels).values() for marker in person}
    for label in labels:
        found = one._found(label)
        guess = "" if found else _guess(plain(label.split(":")[-1]), known)
        guess = "" if guess in taken else guess
        taken.add(guess)
        value = found[1] if found else guess or '""'
        lines.append(f"{quoted(label)}: {value}{'  # guess' if guess else ''}")
    return "\n".join(lines) + "\n"


def _guess(key: str, known: Mapping[str, str]) -> str:
    """Return the marker whose known label is the longest part of a plain label, or similar to it; "": there is none."""
    if UNLABELLED.fullmatch(key) or any(re.fullmatch(pattern, key) for pattern in marker_sets()[FIRST].computed):
        return ""
    parts = [label for label in known if len(label) >= SHORTEST and label in key]
    near = [max(parts, key=len)] if parts else difflib.get_close_matches(key, known, 1, LIKENESS)
    return known[near[0]] if near else ""


def quoted(label: str) -> str:
    """Return a label as a YAML key."""
    return '"' + label.replace("\\", "\\\\").replace('"', '\\"') + '"'
