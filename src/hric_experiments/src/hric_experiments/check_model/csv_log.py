"""Reader of an arm's log from a CSV file: time, and positions, velocities and torques of seven joints."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from franka_hw_interface.arm_log import ArmLog, FloatArray, LogError

JOINTS = 7
TIMES = ("t", "time", "timestamp", "time_s", "t_s", "seconds", "stamp")
STEMS = {
    "q": ("q", "position", "pos", "joint_position"),
    "dq": ("dq", "qd", "qdot", "velocity", "vel", "joint_velocity"),
    "tau": ("tau_j", "tau", "effort", "torque", "joint_torque"),
}
"""Accepted column names of each quantity, without the joint's number or name, the preferred one first. Case is ignored,
and the prefix `field.` of `rostopic echo -p` is allowed."""
MEANINGS = {
    "t": "time [s]",
    "q": "joint positions [rad]",
    "dq": "joint velocities [rad/s]",
    "tau": "measured joint torques [N m]",
}
USUAL = "t, q1 to q7, dq1 to dq7, tau1 to tau7"


def parse_columns(texts: Sequence[str]) -> dict[str, str]:
    """Parse the `KEY=NAME` arguments of --columns; return the names of the columns by key (t, q, dq, tau).

    Raises:
        LogError: an argument does not have this form, or has an unknown key.
    """
    columns = {}
    for text in texts:
        key, separator, value = text.partition("=")
        if key not in MEANINGS or not separator or not value:
            raise LogError(
                f"cannot read {text!r} of --columns; valid: t=NAME, and q=, dq=, tau= with seven names separated by "
                "commas, "
                f"or one name with {{}} for 1 to 7"
            )
        columns[key] = value
    return columns


def read_csv(path: Path, joint_names: Sequence[str], chosen: Mapping[str, str]) -> ArmLog:
    """Read a CSV file with a header, separated by commas, semicolons, tabs or spaces; lines with # are skipped.

    Args:
        path: CSV file.
        joint_names: names of joints 1 to 7.
        chosen: column names in the file by key (t, q, dq, tau), as `parse_columns` returns them; for other keys the
            usual names are looked up.

    Raises:
        LogError: the file cannot be read, columns are missing, or a cell is not a number.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise LogError(f"cannot read {path}: {getattr(error, 'strerror', None) or 'it is not a text file'}") from error
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    header, rows = _header(lines, path.name)
    frequent = max(",;\t", key=header.count)
    delimiter = frequent if frequent in header else None
    names = [name.strip() for name in _cells(header, delimiter)]
    columns = _columns(names, chosen, path.name)
    numbers = [number for number, _ in rows]
    values = _numbers(rows, delimiter, [names.index(column) for column in columns], columns)
    time, q, dq, tau = np.split(values, (1, 1 + JOINTS, 1 + 2 * JOINTS), axis=1)
    return ArmLog(tuple(joint_names), time[:, 0], q, dq, tau, tuple(columns), np.array(numbers, dtype=np.int64), "line")


def _header(lines: list[tuple[int, str]], name: str) -> tuple[str, list[tuple[int, str]]]:
    """Return header and data lines; the header is the first line, or, as numpy writes it, the last comment line."""
    comments = [line for _, line in lines if line.startswith("#")]
    data = [(number, line) for number, line in lines if not line.startswith("#")]
    if data and not _is_data(data[0][1]):
        return data[0][1], data[1:]
    last = comments[-1].lstrip("# ") if comments and data else ""
    if not last or _is_data(last):
        raise LogError(f"{name} has no header; its first line must name the columns, usually {USUAL}")
    return last, data


def _is_data(line: str) -> bool:
    try:
        return bool([float(cell) for cell in re.split(r"[,;\t ]+", line.strip().rstrip(",;"))])
    except ValueError:
        return False


def _cells(line: str, delimiter: str | None) -> list[str]:
    return line.split() if delimiter is None else next(csv.reader([line], delimiter=delimiter))


def _columns(names: Sequence[str], chosen: Mapping[str, str], file: str) -> list[str]:
    """Return the names of the 22 columns of time, positions, velocities and torques."""
    columns = [_named(chosen["t"], names, 1, file) if "t" in chosen else _time(names, file)]
    columns += [
        _named(chosen[key], names, JOINTS, file) if key in chosen else _joints(key, names, file) for key in STEMS
    ]
    flat = [name for group in columns for name in group]
    twice = sorted({name for name in flat if flat.count(name) > 1 or names.count(name) > 1})
    if twice:
        raise LogError(
            f"{file}: column {', '.join(twice)} exists or is selected twice; columns in the file: {', '.join(names)}"
        )
    return flat


def _named(text: str, names: Sequence[str], count: int, file: str) -> list[str]:
    numbered = count > 1 and "{}" in text
    chosen = (
        [text.replace("{}", str(i)) for i in range(1, count + 1)]
        if numbered
        else [name.strip() for name in text.split(",")]
    )
    if len(chosen) != count:
        raise LogError(f"--columns has {len(chosen)} columns in {text!r}; valid: {count}")
    missing = [name for name in chosen if name not in names]
    if missing:
        raise LogError(f"{file} has no column {', '.join(missing)}; columns in the file: {', '.join(names)}")
    return chosen


def _plain(name: str) -> str:
    return re.sub(r"^(%|/|field\.)+", "", name.lower())


def _time(names: Sequence[str], file: str) -> list[str]:
    by_plain = {_plain(name): name for name in reversed(names)}
    for usual in TIMES:
        if usual in by_plain:
            return [by_plain[usual]]
    raise _missing("t", names, file)


def _joints(key: str, names: Sequence[str], file: str) -> list[str]:
    """Return the seven columns of a quantity, which are numbered from 1 or 0 or end with the names of the joints."""
    for stem in STEMS[key]:
        pattern = re.compile(rf"{stem}s?[._ ]?[\[(]?(?:\w*joint)?_?(\d+)[\])]?")
        numbered = {int(match[1]): name for name in reversed(names) if (match := pattern.fullmatch(_plain(name)))}
        for first in (0, 1):
            if set(numbered) == set(range(first, first + JOINTS)):
                return [numbered[first + i] for i in range(JOINTS)]
    raise _missing(key, names, file)


def _missing(key: str, names: Sequence[str], file: str) -> LogError:
    usual, how = ("t", "t=NAME") if key == "t" else (f"{key}1 to {key}7", f"{key}=NAME{{}}")
    return LogError(
        f"{file} has no columns {usual} for the {MEANINGS[key]}; columns in the file: {', '.join(names)}; select "
        f"them with --columns {how}"
        + ("" if key == "t" else " ({} stands for 1 to 7), or seven names separated by commas")
    )


def _numbers(
    rows: list[tuple[int, str]], delimiter: str | None, indices: Sequence[int], columns: Sequence[str]
) -> FloatArray:
    if not rows:
        raise LogError("the CSV file has a header, but no samples")
    try:
        values: FloatArray = np.loadtxt(
            [line for _, line in rows], delimiter=delimiter, usecols=indices, ndmin=2, quotechar='"'
        )
    except (ValueError, IndexError):
        raise _bad_cell(rows, delimiter, indices, columns) from None
    return values


def _bad_cell(
    rows: list[tuple[int, str]], delimiter: str | None, indices: Sequence[int], columns: Sequence[str]
) -> LogError:
    for number, line in rows:
        cells = _cells(line, delimiter)
        for index, column in zip(indices, columns, strict=True):
            cell = cells[index].strip() if index < len(cells) else ""
            try:
                float(cell)
            except ValueError:
                return LogError(
                    f"line {number}, column {column} is {cell!r}; each value must be a number"
                    if cell
                    else f"line {number}, column {column} is missing"
                )
    return LogError("the CSV file has lines that cannot be read as numbers")
