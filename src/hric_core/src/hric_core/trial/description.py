"""Description of the recorded trials that an experiment replays, for run.yaml, as no ROS message contains it."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path

from hric_core.trial.c3d import Trial, read_trial, resolve


def describe(trial: Trial) -> dict[str, object]:
    """Return labels, channels, units, events and force plates of a trial, as plain values."""
    return {
        "up": trial.up,
        "length": trial.length,
        "labels": list(trial.labels),
        "channels": list(trial.channels),
        "units": list(trial.units),
        "events": [list(event) for event in trial.events],
        "plates": {number: {"type": plate.kind, **plate.source} for number, plate in trial.plates.items()},
    }


def replayed_trials(tree: object) -> tuple[object, dict[str, dict[str, object]]]:
    """Return settings with file names in place of the paths of c3d files, and the description of each file by name.

    Files of the same name in different folders get different names, with a number.

    Args:
        tree: settings, mappings within mappings; a file is named by the key `path` next to `program: c3d`.

    Raises:
        HricError: a file cannot be read.
    """
    trials, names = dict[str, dict[str, object]](), dict[Path, str]()

    def named(node: object) -> object:
        if not isinstance(node, Mapping):
            return node
        copy, path = {key: named(value) for key, value in node.items()}, node.get("path")
        if node.get("program") == "c3d" and isinstance(path, str):
            file = resolve(path)
            if file not in names:
                numbered = (f"{file.stem}_{number}{file.suffix}" for number in itertools.count(2))
                names[file] = next(name for name in itertools.chain([file.name], numbered) if name not in trials)
            copy["path"] = names[file]
            trials[names[file]] = describe(read_trial(file, str(node.get("up") or "")))
        return copy

    return named(tree), trials


def labels_of(labels: Sequence[str], body: str) -> list[str]:
    """Return the labels of a body's markers, which begin with its name as in exports of this workspace ("hand_1")."""
    return [label for label in labels if label.startswith((f"{body}_", f"{body}:", f"{body}/")) or label == body]
