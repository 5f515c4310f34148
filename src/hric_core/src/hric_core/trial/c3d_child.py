"""Script that reads a c3d file with ezc3d, in a separate process, as ezc3d crashes on some damaged files.

`c3d.read_trial` runs it. Usage: python3 c3d_child.py FILE OUTPUT. OUTPUT becomes a .npz file with arrays and, as JSON
text, the parameters.
"""

import json
import os
import resource
import struct
import sys
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "PROCESSING", "SUBJECTS", "HRIC")
LATIN_1 = {0xDC00 + byte: byte for byte in range(0x80, 0x100)}
"""Table that makes Latin-1 characters of bytes that are not UTF-8, which Python has as lone surrogates."""
INTEL = 84
"""Processor type of files in the byte order of Intel."""
MEMORY = 4 << 30
"""Memory limit of this process [byte]; numbers in a damaged file can be of any size (project default, unconfirmed)."""


def main(path: str, output: str) -> int:
    """Read the c3d file, write the .npz file and return the exit code; an error is printed to stderr."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try:
        file = ezc3d.c3d(path)
        parameters = {
            group: {
                name: np.asarray(entry["value"]).tolist()
                for name, entry in file["parameters"][group].items()
                if "value" in entry
            }
            for group in GROUPS
            if group in file["parameters"]
        }
        arrays = _arrays(Path(path), file["data"])
    except Exception as error:  # any error of a damaged file means that it cannot be read
        print(" ".join(str(error).split()) or type(error).__name__, file=sys.stderr)
        return 1
    np.savez(output, parameters=np.array(json.dumps(parameters, ensure_ascii=False).translate(LATIN_1)), **arrays)
    return 0


def _arrays(path: Path, data: Any) -> dict[str, Any]:
    """Return points, residuals, analog samples, and the number of samples of a channel in a frame, 0: no channels.

    ezc3d takes the size of a frame from ANALOG:RATE. If that contradicts the header, which has the size, the points are
    read again, by the header, and there are no analog samples.
    """
    points, residuals, analogs = data["points"][:3], data["meta_points"]["residuals"][0], data["analogs"][0]
    content = path.read_bytes()
    count, words, first, last = struct.unpack_from("<4H", content, 2)
    scale, start, per_frame = struct.unpack_from("<fHH", content, 12)
    frames = points.shape[2]
    if words and (not frames or len(analogs) * analogs.shape[1] != words * frames):
        if content[512 * (content[0] - 1) + 3] != INTEL:
            raise ValueError("its rate ANALOG:RATE contradicts its header; valid: a file in the byte order of Intel")
        rows = np.fromfile(path, "<f4" if scale < 0 else "<i2", offset=512 * (start - 1))
        rows = rows[: (last - first + 1) * (4 * count + words)].reshape(-1, 4 * count + words)
        quads = rows[:, : 4 * count].reshape(len(rows), count, 4).T
        points, residuals, analogs = quads[:3] * (1.0 if scale < 0 else scale), quads[3], np.zeros((0, 0))
    elif words:
        per_frame = analogs.shape[1] // frames
    return {
        "points": points,
        "residuals": residuals,
        "analogs": analogs,
        "per_frame": max(1, per_frame) if words else 0,
    }


if __name__ == "__main__":
    code = main(*sys.argv[1:])
    sys.stderr.flush()
    os._exit(code)  # without the destructors of ezc3d, one of which sometimes does not end
