"""Script that reads a c3d file with ezc3d, in a separate process, as ezc3d crashes on some damaged files.

`c3d.read_trial` runs it. Usage: python3 c3d_child.py FILE OUTPUT. OUTPUT becomes a .npz file with arrays and, as JSON
text, the parameters.
"""

import json
import resource
import sys

import ezc3d
import numpy as np

GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "HRIC")
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
