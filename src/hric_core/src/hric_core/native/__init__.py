"""Python interfaces of the extension modules that CMake compiles from C with the workspace (`hric_python_module`)."""

from importlib import import_module
from types import ModuleType

from hric_core.errors import HricError


def load(name: str) -> ModuleType:
    """Return the compiled module of this name.

    Raises:
        HricError: the module is not built, or is built for another version of Python.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise HricError(
            f"the compiled module {name} is not built for this Python ({error}); build the workspace: scripts/setup"
        ) from error
