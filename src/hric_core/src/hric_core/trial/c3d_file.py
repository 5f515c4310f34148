"""Raw content of a c3d file: parameters, points and analog samples, in each byte order of the format.

Source of the format: the C3D User Guide (c3d.org). Frame rate, scale and number of frames are read
from the parameters if they are there, else from the header; numbers of points and samples from the header.

    content = read_content(Path("walk.c3d"))
    content.points, content.parameters["POINT"]["LABELS"]
"""

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_core.trial.plates import Group, first_number, numbers

BLOCK = 512
"""Size of a block of a c3d file [byte]."""
MAGIC = 0x50
"""Second byte of every c3d file, by which the format is recognised."""
INTEL, DEC, SGI = 84, 85, 86
"""Processor types in the parameter section."""
TEXT = -1
SIZES = {TEXT: 1, 1: 1, 2: 2, 4: 4}
"""Size of a value [byte] by the type of a parameter: text, byte, integer, real number."""
MORE = 100
"""Largest number of a parameter that continues another one, as LABELS2 continues LABELS."""


class C3dContent(NamedTuple):
    """Content of a c3d file in the file's axes and units.

    Attributes:
        parameters: parameters by group and name, groups in capitals.
        rate: frame rate [Hz]; NaN: the file has none.
        points: positions, shape (frames, points, 3), in the unit of POINT:UNITS.
        valid: True where a point was measured, shape (frames, points).
        analogs: analog samples, each channel in its unit, shape (channels, samples).
        per_frame: number of samples of a channel in a frame; 0: there are no channels.
        first: number of the first frame.
        damaged: True if some parameters could not be read.
        rest: number of bytes after the last frame, which may be further frames; 0: none.
    """

    parameters: Mapping[str, Group]
    rate: float
    points: FloatArray
    valid: np.ndarray[Any, np.dtype[np.bool_]]
    analogs: FloatArray
    per_frame: int
    first: int
    damaged: bool
    rest: int = 0


def read_content(path: Path) -> C3dContent:
    """Read a c3d file. Raises ParameterError: it cannot be read, is not a c3d file, or is damaged."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ParameterError(f"c3d file {path}: {error.strerror}") from error
    section = BLOCK * (max(data[0], 1) - 1) if data else 0
    if len(data) < BLOCK or data[1] != MAGIC or data[section + 3 : section + 4] not in (b"T", b"U", b"V"):
        raise ParameterError(f"{path} is not a c3d file")
    return _File(path, data, data[section + 3]).content(section)


def all_numbers(group: Group, name: str) -> FloatArray:
    """Return the numbers of a parameter that may continue in NAME2, NAME3, ..., shape (n,)."""
    return np.concatenate([numbers(group, key).ravel() for key in continued(name)])


def continued(name: str) -> list[str]:
    """Return the names under which a parameter of more than 255 values continues: NAME, NAME2, ..."""
    return [name, *(f"{name}{k}" for k in range(2, MORE))]


class _File:
    """Reader of the bytes of a c3d file, in the number format of the processor that wrote it."""

    def __init__(self, path: Path, data: bytes, processor: int) -> None:
        self._path, self._data, self._processor = path, data, processor
        self._order = ">" if processor == SGI else "<"

    def content(self, section: int) -> C3dContent:
        """Return the content; section: begin of the parameters [byte]."""
        points, words, first, last = self._words(2, 4)
        start, per_frame = self._words(16, 2)
        end = (start - 1) * BLOCK if (start - 1) * BLOCK > section else len(self._data)
        parameters, damaged = self._parameters(section + 4, min(end, len(self._data)))
        point, analog = parameters.get("POINT", {}), parameters.get("ANALOG", {})
        scale, rate = (float(number) for number in self._reals(12, 3)[[0, 2]])
        rate = first_number(point, "RATE", 0.0) or rate
        per_frame = (per_frame or 1) if words else 0
        if words and words % per_frame:  # some software writes the number of channels instead
            words = per_frame * int(first_number(analog, "USED", 0.0))
        wide = scale < 0.0  # real numbers instead of integers
        size = (4 * points + words) * (4 if wide else 2)
        longest = (len(self._data) - (start - 1) * BLOCK) // max(size, 1)
        frames = _frames(parameters.get("TRIAL", {}), point, first, last, longest)
        needed = (start - 1) * BLOCK + frames * size
        if frames < 1 or start < 2 or needed > len(self._data):
            raise ParameterError(
                f"c3d file {self._path} is damaged: {frames} frames by its header need {needed} bytes, and the file "
                f"has {len(self._data)}"
            )
        rest = len(self._data) - needed
        count, at = frames * (4 * points + words), (start - 1) * BLOCK
        rows = (self._reals(at, count) if wide else self._integers(at, count)).reshape(frames, -1)
        quads = rows[:, : 4 * points].reshape(frames, points, 4)
        samples = rows[:, 4 * points :].reshape(frames * per_frame, words // max(1, per_frame)).T
        return C3dContent(
            parameters,
            rate if math.isfinite(rate) else math.nan,
            quads[..., :3] * (1.0 if wide else first_number(point, "SCALE", scale)),
            quads[..., 3] >= 0.0,
            _scaled(analog, samples, wide),
            per_frame,
            first,
            damaged or first_number(point, "USED") != points,
            rest if rest >= max(BLOCK, size) else 0,
        )

    def _parameters(self, begin: int, end: int) -> tuple[dict[str, Group], bool]:
        """Return the parameters between two positions [byte], and True if some are damaged and left out."""
        groups, entries, damaged = dict[int, str](), list[tuple[int, str, list[Any] | None]](), False
        while begin + 4 <= end:
            length, number = struct.unpack_from("bb", self._data, begin)
            after = begin + 2 + abs(length)  # the length of a locked name is negative
            if not length or not number or after + 2 > len(self._data):
                break
            name = _text(self._data[begin + 2 : after])
            damaged |= not name.isprintable()
            if number < 0:
                groups[-number] = name.upper()
            else:
                entries.append((number, name, self._value(after + 2)))
            step = self._words(after, 1)[0]
            if step < 2:
                damaged |= step != 0
                break
            begin = after + step
        named: dict[str, dict[str, list[Any]]] = {name: {} for name in groups.values()}
        for number, name, value in entries:
            if number in groups and value is not None:
                named[groups[number]][name] = value
            else:
                damaged = True
        return dict(named), damaged

    def _value(self, at: int) -> list[Any] | None:
        """Return the value of the parameter at byte `at`, an array as nested lists; None: it is damaged."""
        kind, dimensions = struct.unpack_from("bB", self._data[at : at + 2].ljust(2, b"\0"))
        shape = list(self._data[at + 2 : at + 2 + dimensions])
        start, count = at + 2 + dimensions, math.prod(shape)
        if kind not in SIZES or start + count * SIZES[kind] > len(self._data):
            return None
        if not count:
            return []
        if kind == TEXT:
            width = shape[0] if shape else 1
            raw = self._data[start : start + count]
            return [_text(raw[begin : begin + width]) for begin in range(0, count, max(1, width))]
        if kind == 1:
            values = np.frombuffer(self._data, "i1", count, start).astype(float)
        else:
            values = self._integers(start, count) if kind == 2 else self._reals(start, count)
        return list(values.reshape(shape or 1, order="F").tolist())

    def _words(self, at: int, count: int) -> list[int]:
        """Return `count` unsigned 16-bit integers, from byte `at` on."""
        return list(struct.unpack_from(f"{self._order}{count}H", self._data, at))

    def _integers(self, at: int, count: int) -> FloatArray:
        return np.frombuffer(self._data, f"{self._order}i2", count, at).astype(float)

    def _reals(self, at: int, count: int) -> FloatArray:
        """Return `count` real numbers from byte `at` on; DEC's have the upper word first and look 4 times too large."""
        with np.errstate(invalid="ignore"):  # of numbers that are NaN
            if self._processor != DEC:
                return np.frombuffer(self._data, f"{self._order}f4", count, at).astype(float)
            words = np.frombuffer(self._data, "<u2", 2 * count, at).reshape(count, 2)
            return 0.25 * np.ascontiguousarray(words[:, ::-1]).view("<f4").ravel().astype(float)


def _frames(trial: Group, point: Group, first: int, last: int, longest: int) -> int:
    """Return the number of frames: by the header, or by TRIAL, which has numbers above 65535 as two words.

    If POINT states more frames, that number is used, provided that the file is long enough (`longest`).
    """
    ends = [numbers(trial, f"ACTUAL_{end}_FIELD").ravel() for end in ("START", "END")]
    if all(len(words) == 2 and np.isfinite(words).all() for words in ends):
        first, last = (int(low) % 65536 + 65536 * (int(high) % 65536) for low, high in ends)
    stated = first_number(point, "LONG_FRAMES", 0.0), first_number(point, "FRAMES", 0.0) % 65536.0
    return max([last - first + 1, *(int(count) for count in stated if count <= longest)])


def _scaled(analog: Group, samples: FloatArray, wide: bool) -> FloatArray:
    """Return analog samples in their units, shape (channels, samples): (sample - OFFSET) SCALE GEN_SCALE."""
    channels = len(samples)
    offsets, scales = np.zeros(channels), np.ones(channels)
    for array, name in ((offsets, "OFFSET"), (scales, "SCALE")):
        values = all_numbers(analog, name)[:channels]
        array[: len(values)] = values
    if not wide and [str(word).strip().upper() for word in analog.get("FORMAT", [])[:1]] == ["UNSIGNED"]:
        samples, offsets = samples % 65536.0, offsets % 65536.0
    return (samples - offsets[:, None]) * scales[:, None] * first_number(analog, "GEN_SCALE", 1.0)


def _text(raw: bytes) -> str:
    """Return a text of a file: UTF-8, or Latin-1 as older software writes it."""
    try:
        return raw.decode()
    except UnicodeDecodeError:
        return raw.decode("latin-1")
