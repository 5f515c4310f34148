"""Loading of OpenSim's libraries in an order that makes OpenSim fast.

OpenSim's Python modules contain slow copies of Simbody's small functions (e.g. products of 3 x 3 matrices), compiled
without inlining. If Simbody's libraries are loaded as dependencies of such a module, the dynamic linker searches the
module first and binds the libraries to the slow copies. If they are loaded before the module, they use their own
optimised functions: a step of OpenSim then takes little more than half the time, with the same results.
"""

import contextlib
import ctypes
import importlib
import sys
from importlib.util import find_spec
from pathlib import Path

SIMBODY = ("libSimTKcommon.so", "libSimTKmath.so", "libSimTKsimbody.so")
"""Simbody's libraries in the order of their dependencies."""


def load_opensim() -> None:
    """Import OpenSim with Simbody's libraries loaded first, without its log file, and with its errors only."""
    load_simbody_first()
    logger = importlib.import_module("opensim").Logger
    logger.removeFileSink()
    logger.setLevelString("Error")


def load_simbody_first() -> bool:
    """Load Simbody's libraries before OpenSim's Python modules, to make OpenSim faster; return False if too late."""
    spec = find_spec("opensim")
    if "opensim" in sys.modules or spec is None or spec.origin is None:
        return False
    folder = Path(spec.origin).parent
    with contextlib.suppress(OSError):
        for name in SIMBODY:
            # The modules request the versioned name; with another name the linker would load the library twice.
            versions = sorted(folder.glob(f"{name}.*.*"))
            ctypes.CDLL(str(versions[0] if versions else folder / name))
        return True
    return False
