"""Converter of c3d files of Intel byte order, as ezc3d writes them, to those of DEC and SGI machines."""

import struct

import numpy as np

INTEL, DEC, SGI = 84, 85, 86
"""Processor types of the format."""
SIZES = {-1: 1, 1: 1, 2: 2, 4: 4}
"""Size of a value [byte] by the type of a parameter."""


def converted(data: bytes, processor: int) -> bytes:
    """Return the bytes of a file with floating point data in the order of a processor; events are not converted."""
    head, parameters = data[:512], (data[0] - 1) * 512
    start = (struct.unpack_from("<H", head, 16)[0] - 1) * 512
    words = _words(head[2:12], processor), _words(head[16:20], processor), _words(head[24:], processor)
    new = head[:2] + words[0] + _reals(head[12:16], processor) + words[1] + _reals(head[20:24], processor) + words[2]
    section = bytearray(data[parameters:start])
    section[3] = processor
    place = 4
    while section[place]:
        name = abs(struct.unpack_from("b", section, place)[0])
        is_group = struct.unpack_from("b", section, place + 1)[0] < 0
        place += 2 + name
        (step,) = struct.unpack_from("<h", section, place)
        section[place : place + 2] = _words(bytes(section[place : place + 2]), processor)
        if not is_group:
            _convert_values(section, place + 2, processor)
        if step == 0:
            break
        place += step
    return new + data[512:parameters] + bytes(section) + _reals(data[start:], processor)


def _convert_values(section: bytearray, place: int, processor: int) -> None:
    kind, dimensions = struct.unpack_from("bB", section, place)
    first = place + 2 + dimensions
    last = first + SIZES[kind] * int(np.prod(list(section[place + 2 : first]), dtype=int))
    if kind in (2, 4):
        convert = _words if kind == 2 else _reals
        section[first:last] = convert(bytes(section[first:last]), processor)


def _words(raw: bytes, processor: int) -> bytes:
    return np.frombuffer(raw, "<u2").astype(">u2" if processor == SGI else "<u2").tobytes()


def _reals(raw: bytes, processor: int) -> bytes:
    """A real number of DEC is four times the IEEE number with the same bits, and its upper word comes first."""
    values = np.frombuffer(raw, "<f4")
    if processor == SGI:
        return values.astype(">f4").tobytes()
    return np.frombuffer((4.0 * values).astype("<f4").tobytes(), "<u2").reshape(-1, 2)[:, ::-1].tobytes()
