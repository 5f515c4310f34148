"""Files of a LeRobot data set, version 3.0 (github.com/huggingface/lerobot): frames, episodes, tasks and statistics."""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags.export import recording
from hric_bags.export.lerobot.episode import NEEDED as NEEDED
from hric_bags.export.lerobot.episode import RunEpisode, of_run
from hric_bags.export.table import ExportError, TopicTable
from hric_bags.run_file import RunFile

VERSION = "v3.0"
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
"""Names of data files below their folder; all frames and all episodes are in the first."""
CHUNK, DATA_SIZE, VIDEO_SIZE = 1000, 100, 200
"""Files per chunk, and sizes of files [MB], which LeRobot's own writer keeps (lerobot 0.4.4, datasets/utils.py)."""
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)
INDEX = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Columns that each data set has -> their data type."""
Array = np.ndarray[Any, np.dtype[Any]]


def read(
    tables: Mapping[str, TopicTable], run: RunFile, others: Sequence[recording.ExportSource], rate: float
) -> list[RunEpisode]:
    """Return the episodes of a run, given by its tables and run.yaml, and of other runs, which are read here."""
    return [of_run(tables, run, rate), *(of_run(recording.read(o, types=NEEDED), o.run, rate) for o in others)]


def files(episodes: Sequence[RunEpisode], rate: float) -> dict[str, Callable[[Path], object]]:
    """Return the writers of the files of a data set, by path below its folder.

    Args:
        episodes: episodes in order, with the same features.
        rate: frames per second, a whole number [Hz].

    Raises:
        ExportError: the episodes differ in their features.
    """
    _check(episodes)
    tasks = list(dict.fromkeys(episode.task for episode in episodes))
    starts = np.cumsum([0, *(episode.length for episode in episodes)])
    columns = [_columns(e, k, int(starts[k]), tasks.index(e.task), rate) for k, e in enumerate(episodes)]
    joined = {name: np.concatenate([part[name] for part in columns]) for name in columns[0]}
    first = FILE.format(chunk_index=0, file_index=0)
    return {
        f"data/{first}.parquet": partial(_write_columns, joined),
        f"meta/episodes/{first}.parquet": partial(_write_rows, _episode_rows(episodes, columns, starts)),
        "meta/tasks.parquet": partial(_write_tasks, tasks),
        "meta/stats.json": partial(_write_json, {name: _statistics(values) for name, values in joined.items()}),
        "meta/info.json": partial(_write_json, _info(episodes, rate, len(tasks))),
    }


def notes(episodes: Sequence[RunEpisode]) -> list[str]:
    """Return the sentences on how the values of the episodes were obtained, each once."""
    return list(dict.fromkeys(note for episode in episodes for note in episode.notes))


def _check(episodes: Sequence[RunEpisode]) -> None:
    first = {name: (feature.names, feature.units) for name, feature in episodes[0].features.items()}
    for number, episode in enumerate(episodes[1:], start=2):
        other = {name: (feature.names, feature.units) for name, feature in episode.features.items()}
        if different := sorted(name for name in {*first, *other} if first.get(name) != other.get(name)):
            raise ExportError(
                f"run {number} differs from the first one in {', '.join(different)}; valid: runs of one robot and the "
                "same persons, commanded by the same interface"
            )


def _columns(episode: RunEpisode, number: int, start: int, task: int, rate: float) -> dict[str, Array]:
    frames = np.arange(episode.length)
    index = (frames / rate, frames, np.full(len(frames), number), start + frames, np.full(len(frames), task))
    columns = {name: feature.values.astype(np.float32) for name, feature in episode.features.items()}
    return columns | {name: column.astype(kind) for (name, kind), column in zip(INDEX.items(), index, strict=True)}


def _statistics(values: Array) -> dict[str, list[float]]:
    rows = values.reshape(len(values), -1).astype(float)
    named = {"min": rows.min(0), "max": rows.max(0), "mean": rows.mean(0), "std": rows.std(0)}
    named |= {f"q{100 * share:02.0f}": np.quantile(rows, share, axis=0) for share in QUANTILES}
    return {name: result.tolist() for name, result in named.items()} | {"count": [len(rows)]}


def _episode_rows(
    episodes: Sequence[RunEpisode], columns: Sequence[dict[str, Array]], starts: Array
) -> list[dict[str, Any]]:
    rows = []
    for number, (episode, values) in enumerate(zip(episodes, columns, strict=True)):
        row: dict[str, Any] = {"episode_index": number, "tasks": [episode.task], "length": episode.length}
        row |= {"data/chunk_index": 0, "data/file_index": 0}
        row |= {"dataset_from_index": int(starts[number]), "dataset_to_index": int(starts[number + 1])}
        for name, column in values.items():
            row |= {f"stats/{name}/{key}": value for key, value in _statistics(column).items()}
        rows.append(row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0})
    return rows


def _info(episodes: Sequence[RunEpisode], rate: float, tasks: int) -> dict[str, Any]:
    features: dict[str, Any] = {
        name: {
            "dtype": "float32",
            "shape": [len(feature.names)],
            "names": list(feature.names),
            "units": list(feature.units),
        }
        for name, feature in episodes[0].features.items()
    }
    return {
        "codebase_version": VERSION,
        "robot_type": episodes[0].robot,
        "total_episodes": len(episodes),
        "total_frames": sum(episode.length for episode in episodes),
        "total_tasks": tasks,
        "chunks_size": CHUNK,
        "data_files_size_in_mb": DATA_SIZE,
        "video_files_size_in_mb": VIDEO_SIZE,
        "fps": round(rate),
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": f"data/{FILE}.parquet",
        "video_path": None,
        "notes": notes(episodes),
        "features": features | {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in INDEX.items()},
    }


def _write_columns(columns: dict[str, Array], path: Path) -> None:
    import pyarrow as pa  # here and below: slow to import
    import pyarrow.parquet

    arrays = {
        name: pa.array(values)
        if values.ndim == 1
        else pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
        for name, values in columns.items()
    }
    pyarrow.parquet.write_table(pa.table(arrays), path)


def _write_rows(rows: list[dict[str, Any]], path: Path) -> None:
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), path)


def _write_tasks(tasks: list[str], path: Path) -> None:
    import pandas

    pandas.DataFrame({"task_index": range(len(tasks))}, index=tasks).to_parquet(path)


def _write_json(content: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n")
