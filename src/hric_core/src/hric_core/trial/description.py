"""Description of the recorded trials that an experiment replays, for run.yaml: what messages cannot hold."""

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


def replayed_trials(tree: object) -> dict[str, dict[str, object]]:
    """Return the descriptions of the c3d files that the settings of an experiment replay, by name of the file.

    Args:
        tree: settings, mappings within mappings; a file is named by the key `path` beside `program: c3d`.

    Raises:
        HricError: a file cannot be read.
    """
    if not isinstance(tree, Mapping):
        return {}
    trials = dict[str, dict[str, object]]()
    for value in tree.values():
        trials |= replayed_trials(value)
    path = tree.get("path")
    if tree.get("program") == "c3d" and isinstance(path, str):
        file = resolve(path)
        trials[Path(file).name] = describe(read_trial(file, str(tree.get("up") or "")))
    return trials


def labels_of(labels: Sequence[str], body: str) -> list[str]:
    """Return the labels of a body's markers, which begin with its name as in exports of this workspace ("hand_1")."""
    return [label for label in labels if label.startswith((f"{body}_", f"{body}:", f"{body}/")) or label == body]
