"""Compiles C source to a shared library with the system's compiler; results are kept in the user's cache folder."""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path

from hric_control.errors import HricError

COMPILERS = ("cc", "gcc", "clang")
# No fused multiply-add: the same results on every machine. Only what is marked EXPORT is visible.
FLAGS = ("-std=c11", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off", "-x", "c", "-", "-lm")
TIMEOUT = 60.0
"""Wall time that the compiler may take; it needs a fraction of a second [s]."""
ELF = b"\x7fELF"


def compile_cached(source: str, name: str, include: tuple[str, ...] = ()) -> bytes:
    """Compile, or take the result of an earlier time with the same source, compiler and flags.

    The cache is $XDG_CACHE_HOME/hric, else ~/.cache/hric. If it cannot be written, nothing is kept. A damaged file in it is compiled again.

    Args:
        source: C11.
        name: first part of the cached file's name.
        include: folders with header files.

    Returns:
        The shared library.

    Raises:
        HricError: no compiler, or it failed.
    """
    compiler = (*_compiler(), *(f"-I{folder}" for folder in include))
    key = _digest("\0".join([*compiler, *FLAGS, _version(compiler[0]), platform.machine(), source]).encode())
    folder = cache_folder()
    found = None if folder is None else _cached(folder, f"{name}_{key}_")
    if found is not None:
        return found
    library = _compile(source, compiler)
    if folder is not None:
        _keep(folder, f"{name}_{key}_{_digest(library)}.so", library)
    return library


def cache_folder() -> Path | None:
    """Where compiled libraries are kept; it need not exist. None: the user has no home."""
    for base in (os.environ.get("XDG_CACHE_HOME", ""), os.path.expanduser("~/.cache")):
        if os.path.isabs(base):  # the XDG base directory specification: a relative path is to be ignored
            return Path(base) / "hric"
    return None


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:32]


def _compiler() -> tuple[str, ...]:
    """Path and options of the compiler: $CC, else the first of COMPILERS."""
    given = os.environ.get("CC", "").split()
    for candidate in (given,) if given else ([name] for name in COMPILERS):
        path = shutil.which(candidate[0])
        if path is not None:
            return (path, *candidate[1:])
    asked = f"$CC = {' '.join(given)}" if given else ", ".join(COMPILERS)
    raise HricError(f"compiled code needs a C compiler and there is none ({asked}); install it: sudo apt install build-essential")


@functools.cache
def _version(path: str) -> str:
    return _run([path, "--version"], "").decode(errors="replace")


def _run(command: list[str], text: str) -> bytes:
    try:
        done = subprocess.run(command, input=text.encode(), capture_output=True, timeout=TIMEOUT, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise HricError(f"the C compiler {command[0]} does not run: {error}") from error
    if done.returncode != 0:
        told = done.stderr.decode(errors="replace").strip().splitlines()[:5]
        raise HricError(f"the C compiler {command[0]} failed with exit code {done.returncode}: {' | '.join(told) or 'it said nothing'}")
    return done.stdout


def _compile(source: str, compiler: tuple[str, ...]) -> bytes:
    try:
        with tempfile.TemporaryDirectory(prefix="hric_compile_") as folder:
            path = Path(folder) / "library.so"
            _run([*compiler, "-o", str(path), *FLAGS], source)
            return path.read_bytes()
    except OSError as error:
        raise HricError(f"nothing can be compiled in {tempfile.gettempdir()}: {error.strerror or error}") from error


def _cached(folder: Path, prefix: str) -> bytes | None:
    """The library whose name starts so, if its contents are those that its name tells."""
    try:
        for path in folder.glob(f"{prefix}*.so"):
            library = path.read_bytes()
            if library.startswith(ELF) and path.name == f"{prefix}{_digest(library)}.so":
                return library
            path.unlink()
    except OSError:
        pass  # a cache that cannot be read is no cache
    return None


def _keep(folder: Path, name: str, library: bytes) -> None:
    """Put the library into the cache, whole or not at all."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor, temporary = tempfile.mkstemp(dir=folder, prefix=".library_", suffix=".tmp")
    except OSError:
        return  # compiled again next time
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(library)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, folder / name)
    except OSError:
        Path(temporary).unlink(missing_ok=True)
