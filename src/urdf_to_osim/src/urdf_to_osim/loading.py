"""Loads OpenSim's libraries such that they run at their own speed.

OpenSim's Python modules carry slow copies of Simbody's small functions (products of 3 x 3 matrices and the like),
compiled without inlining. A library that is first loaded as a part of such a module is bound to these copies by the
dynamic linker, which looks in the module before it looks in the library. Loaded before the modules, each library is
bound to its own, compiled with all optimisation: a step of OpenSim then takes little more than half the time, with the
same results.
"""

import contextlib
import ctypes
import importlib
import sys
from importlib.util import find_spec
from pathlib import Path

SIMBODY = ("libSimTKcommon.so", "libSimTKmath.so", "libSimTKsimbody.so")
"""In the order in which they need each other."""


def load_opensim() -> None:
    """Import OpenSim with Simbody's libraries loaded first, and without the log file that it would write where the user
    happens to stand."""
    load_simbody_first()
    importlib.import_module("opensim").Logger.removeFileSink()


def load_simbody_first() -> bool:
    """Load Simbody's libraries before OpenSim's Python modules; whether that was possible. It is an optimisation:
    nothing depends on it."""
    spec = find_spec("opensim")
    if "opensim" in sys.modules or spec is None or spec.origin is None:
        return False
    folder = Path(spec.origin).parent
    with contextlib.suppress(OSError):
        for name in SIMBODY:
            # By the name with the version, as the modules request it: else the linker would load it a second time.
            versions = sorted(folder.glob(f"{name}.*.*"))
            ctypes.CDLL(str(versions[0] if versions else folder / name))
        return True
    return False
