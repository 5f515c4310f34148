"""Data sets that cannot ship with the workspace: columns of a CSV or HDF5 file, read from a path of the user."""

from pathlib import Path

import numpy as np
import pandas

from hric_core.errors import HricError
from hric_measurements.reproduction.definition import DataSet

SUFFIXES = (".csv", ".h5", ".hdf5")
"""Suffixes of data set files."""


def find(path: Path, name: str) -> Path | None:
    """Return the data set of an experiment: a file itself, or the file of a folder that is named like the experiment.

    None: the folder has no such file.

    Raises:
        HricError: `path` is neither a folder nor a data set.
    """
    if path.is_dir():
        return next((path / f"{name}{suffix}" for suffix in SUFFIXES if (path / f"{name}{suffix}").is_file()), None)
    if not path.is_file() or path.suffix not in SUFFIXES:
        raise HricError(f"no data set {path}; valid: a folder, or a file with the suffix {', '.join(SUFFIXES)}")
    return path


def read(path: Path) -> DataSet:
    """Return the columns of a data set: columns of a CSV file, or one-dimensional data sets at the root of HDF5.

    Raises:
        HricError: the file cannot be read, or a value is not a finite number.
    """
    try:
        columns = _hdf5(path) if path.suffix != ".csv" else dict(pandas.read_csv(path, comment="#").items())
        data = {str(name): np.asarray(values, dtype=np.float64) for name, values in columns.items()}
    except (OSError, ValueError) as error:
        raise HricError(f"cannot read the data set {path}: {error}; valid: columns of numbers") from error
    for name, values in data.items():
        if not len(values) or not np.isfinite(values).all():
            raise HricError(f"{path}: column {name} is empty or has values that are not finite; valid: numbers")
    return data


def _hdf5(path: Path) -> DataSet:
    import h5py  # imported here: slow to load, and needed for this format only

    with h5py.File(path) as file:
        return {name: item[()] for name, item in file.items() if isinstance(item, h5py.Dataset) and item.ndim == 1}
