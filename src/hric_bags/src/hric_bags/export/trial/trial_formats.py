"""Formats of a whole trial, with markers, force plates and EMG on one time grid; writers are loaded on demand."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from hric_bags.export.opensim_formats import OpenSimMarkers
from hric_bags.export.trial import replayed_trial
from hric_bags.export.trial.c3d_trial import C3dTrial
from hric_bags.run_file import RunFile

KINDS = ("c3d", "bids", "xdf")
Writer = Callable[[Path], object]


def trial_files(kind: str, trial: C3dTrial, run: RunFile, stem: str, started: str) -> dict[str, Writer]:
    """Return the writers of a trial's files, by name of the file.

    Args:
        kind: one of KINDS.
        trial: trial to be written.
        run: contents of run.yaml; may be empty.
        stem: file name without extension.
        started: start of the run, for c3d; empty: not written.

    Raises:
        ExportError: the format has no place for anything in the trial.
    """
    if kind == "bids":
        from hric_bags.export.trial.bids import bids_files

        return bids_files(trial, run)
    if kind == "xdf":
        from hric_bags.export.trial.xdf import write_xdf

        return {f"{stem}.xdf": partial(write_xdf, trial=trial)}
    from hric_bags.export.trial import c3d_format

    pieces = list(c3d_format.parts(trial))
    names = [f"{stem}_{part}.c3d" if len(pieces) > 1 else f"{stem}.c3d" for part in range(1, len(pieces) + 1)]
    return {name: partial(c3d_format.write, piece, started=started) for name, piece in zip(names, pieces, strict=True)}


def with_own_labels(markers: OpenSimMarkers, run: RunFile) -> OpenSimMarkers:
    """Return markers with the labels of the file that the run replayed, if it did."""
    replayed = replayed_trial.of_run(run)
    if replayed is None:
        return markers
    return replace(markers, positions={replayed.label(name) or name: p for name, p in markers.positions.items()})
