"""Reader of a c3d file through ezc3d, in its own process: that library ends its process on some damaged files.

Run by `c3d.read_trial`. Usage: python3 c3d_child.py FILE OUTPUT. OUTPUT becomes a .npz with arrays and, as JSON text,
the parameters.
"""

import json
import resource
import sys

import ezc3d
import numpy as np

GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "HRIC")
MEMORY = 4 << 30
"""Memory limit of a reading [byte]; counts in a damaged file can be of any size (project default, unconfirmed)."""


def main(path: str, output: str) -> int:
    """Read the file and return the exit code; the reason of a failure goes to stderr."""
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
        data = file["data"]
        arrays = {
            "points": data["points"][:3],
            "residuals": data["meta_points"]["residuals"][0],
            "analogs": data["analogs"][0],
        }
    except Exception as error:  # any error of a damaged file means that it cannot be read
        print(" ".join(str(error).split()) or type(error).__name__, file=sys.stderr)
        return 1
    np.savez(output, parameters=np.array(json.dumps(parameters)), **arrays)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
