"""Loading of OpenSim's libraries in an order that gives full speed.

OpenSim's Python modules contain slow copies of Simbody's small functions (products of 3 x 3 matrices and the like),
compiled without inlining. The dynamic linker binds a library that is first loaded as part of such a module to these
copies, because it searches the module before the library. If the libraries are loaded before the modules, each uses its
own optimised functions: a step of OpenSim then takes little more than half the time, with the same results.
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
    """Import OpenSim with Simbody's libraries loaded first, and without its log file in the working folder."""
    load_simbody_first()
    importlib.import_module("opensim").Logger.removeFileSink()


def load_simbody_first() -> bool:
    """Load Simbody's libraries before OpenSim's modules, an optimisation; return True if that was possible."""
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
