"""Look-up of files by name or path, and of classes and functions by name or MODULE:NAME."""

import importlib
from pathlib import Path
from typing import Any

from hric_core.errors import ParameterError, UnknownNameError
from hric_core.parameters import Settings, refused


class FileSettings(Settings):
    """Settings of a sweep, study or sampler from a YAML file; messages and tables join nested keys by dots."""

    separator = "."


def file_of(name: str, kind: str, folder: Path) -> Path:
    """Return the path of a YAML file, given by its path or name.

    Args:
        name: path of the file, or name of a file in the folder, without its ending.
        kind: content of the file in one word, for error messages.
        folder: folder with the files of this workspace.

    Raises:
        HricError: there is no such file.
    """
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    if name.endswith((".yaml", ".yml")):
        path = Path(name).expanduser().absolute()
        if not path.is_file():
            raise ParameterError(f"no {kind} file {name}; valid names of {kind} files: {', '.join(known)}")
        return path
    if name not in known:
        raise UnknownNameError(kind, name, known, f"the {kind} files (the path of a YAML file is valid, too)")
    return folder / f"{name}.yaml"


def imported(name: str, where: str) -> Any:
    """Import an object by MODULE:NAME.

    Args:
        name: importable module and name of an object in it, such as `my_package.samplers:Halton`.
        where: key of the settings that has this value, for error messages.

    Raises:
        ParameterError: there is no such module, or no such object in it.
    """
    module, _, attribute = name.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise refused(where, name, f"MODULE:NAME that can be imported ({error})") from error


class Kinds(dict[str, type[Settings]]):
    """Settings classes by the value of the key `kind`; MODULE:CLASS names a class of another package."""

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or (isinstance(name, str) and ":" in name)

    def __missing__(self, name: str) -> type[Settings]:
        kind = imported(name, "kind")
        if not (isinstance(kind, type) and issubclass(kind, Settings)):
            raise ParameterError(f"{name} is no valid kind; valid: a subclass of hric_core.parameters.Settings")
        return kind
