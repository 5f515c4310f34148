"""Writers of tables as NumPy, CSV and Parquet files, each with its topic, frame, axes, rate and units."""

import json
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from hric_bags.export.table import ABOUT, TopicTable


def write_npz(table: TopicTable, path: Path) -> None:
    """Write a table as .npz: arrays `time`, `stamp` and one per column, and the description `about` as JSON text."""
    arrays = {ABOUT: np.array(table.about_text()), **{name: column.values for name, column in table.named().items()}}
    # numpy.savez does not accept a column named "file".
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, array, allow_pickle=False)


def write_csv(table: TopicTable, path: Path) -> None:
    """Write a table as CSV below lines with # that describe it; `pandas.read_csv(path, comment="#")` reads it."""
    lines = [f"# {key}: {json.dumps(value)}" for key, value in table.about().items() if key != "units"]
    lines += [f"# unit of {name}: {column.unit or 'none or not known'}" for name, column in table.named().items()]
    with path.open("wb") as file:
        file.write(("\n".join(lines) + "\n").encode())
        pyarrow.csv.write_csv(_arrow(table), file)


def write_parquet(table: TopicTable, path: Path) -> None:
    """Write a table as Parquet; units are in the metadata of fields, the description in that of the schema, "hric"."""
    pyarrow.parquet.write_table(_arrow(table), path)


def _arrow(table: TopicTable) -> pa.Table:
    columns = table.named()
    built = [pa.array(column.values) for column in columns.values()]
    fields = [
        pa.field(name, array.type, metadata={"unit": columns[name].unit})
        for name, array in zip(columns, built, strict=True)
    ]
    return pa.Table.from_arrays(built, schema=pa.schema(fields, metadata={"hric": table.about_text()}))


WRITERS = {"npz": write_npz, "csv": write_csv, "parquet": write_parquet}
"""Name of the format, which is also the file extension -> its writer."""
