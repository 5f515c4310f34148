"""How C source is compiled and cached, and made into modules of Python."""

from __future__ import annotations

import multiprocessing
import os
import shutil
from pathlib import Path

import pytest

from hric_control.compiler import compile_cached
from hric_control.errors import HricError
from hric_control.extension import load_extension
from hric_control.vectors import SOURCE as VECTORS

SOURCE = '__attribute__((visibility("default"))) int answer(void) { return 42; }\n'


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of this test, and a compiler that counts its calls."""
    compiler = tmp_path / "compiler"
    compiler.write_text(f'#!/bin/sh\ncase "$1" in --version) ;; *) echo called >> "{tmp_path}/calls" ;; esac\nexec {shutil.which("cc")} "$@"\n')
    compiler.chmod(0o755)
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "hric"


def calls(cache: Path) -> int:
    counted = cache.parents[1] / "calls"
    return len(counted.read_text().splitlines()) if counted.exists() else 0


def test_a_library_is_compiled_once_and_again_when_the_source_changes(cache: Path) -> None:
    first = compile_cached(SOURCE, "test")
    assert compile_cached(SOURCE, "test") == first and calls(cache) == 1
    assert [path.name.startswith("test_") and path.suffix == ".so" for path in cache.iterdir()] == [True]
    assert compile_cached(SOURCE.replace("42", "43"), "test") != first and calls(cache) == 2


def test_a_damaged_file_in_the_cache_is_compiled_again(cache: Path) -> None:
    first = compile_cached(SOURCE, "test")
    (path,) = cache.iterdir()
    path.write_bytes(first[: len(first) // 2])
    assert compile_cached(SOURCE, "test") == first and calls(cache) == 2
    assert path.read_bytes() == first


def test_without_a_cache_that_can_be_written_it_is_compiled_all_the_same(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = cache.parents[1] / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert compile_cached(SOURCE, "test").startswith(b"\x7fELF")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setenv("HOME", str(blocked))
    assert compile_cached(SOURCE, "test").startswith(b"\x7fELF") and calls(cache) == 2
    assert not Path("relative").exists() and blocked.read_text() == ""


def test_processes_that_compile_at_once_leave_one_whole_file(cache: Path) -> None:
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        libraries = pool.starmap(compile_cached, [(SOURCE, "test")] * 4)
    assert len(set(libraries)) == 1
    assert [path.read_bytes() for path in cache.iterdir()] == [libraries[0]]


def test_without_a_compiler_the_error_says_what_to_install(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", str(cache))
    with pytest.raises(HricError, match=r"needs a C compiler and there is none \(cc, gcc, clang\); install it: sudo apt install build-essential"):
        compile_cached(SOURCE, "test")
    monkeypatch.setenv("CC", "nowhere-cc -m64")
    with pytest.raises(HricError, match=r"\$CC = nowhere-cc -m64"):
        compile_cached(SOURCE, "test")


def test_a_compiler_that_fails_is_quoted_and_leaves_nothing(cache: Path) -> None:
    with pytest.raises(HricError, match=r"failed with exit code 1: .*error.*answr"):
        compile_cached("int answer(void) { return answr; }", "test")
    assert not cache.exists() or not os.listdir(cache)


def test_a_source_with_pythons_headers_becomes_a_module_without_a_warning(cache: Path) -> None:
    os.environ["CC"] += " -Wall -Wextra -Werror -Wno-missing-field-initializers"
    assert load_extension(VECTORS.read_text(), "hric_vectors").add([1.0], [2.0]) == [3.0] and calls(cache) == 1
    load_extension(VECTORS.read_text(), "hric_vectors")
    assert calls(cache) == 1


def test_a_source_without_its_module_is_refused_by_name(cache: Path) -> None:
    with pytest.raises(HricError, match=r"the compiled module nothing cannot be loaded: .*PyInit_nothing"):
        load_extension(SOURCE, "nothing")
