"""Extension modules of Python, compiled from C on first use and cached: for the few sums of a cycle that plain Python is too slow for."""

from __future__ import annotations

import sys
import sysconfig
import tempfile
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

from hric_control.compiler import compile_cached
from hric_control.errors import HricError


def load_extension(source: str, name: str) -> ModuleType:
    """The module of the C source.

    Args:
        source: C11 with the function PyInit_<name>; it must be visible.
        name: of the module.

    Raises:
        HricError: no compiler, it failed (Python's headers are missing, say), or what it made cannot be loaded.
    """
    version = f"py{sys.version_info.major}{sys.version_info.minor}"
    library = compile_cached(source, f"{name}_{version}", (sysconfig.get_paths()["include"],))
    with tempfile.TemporaryDirectory(prefix="hric_extension_") as folder:
        path = Path(folder) / f"{name}.so"
        try:
            path.write_bytes(library)
            spec = spec_from_loader(name, ExtensionFileLoader(name, str(path)))
            assert spec is not None and spec.loader is not None
            module = module_from_spec(spec)
            spec.loader.exec_module(module)
        except (OSError, ImportError) as error:
            raise HricError(f"the compiled module {name} cannot be loaded: {error}") from error
    return module
