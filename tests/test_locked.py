"""Only pinned packages are installed: an archive with another hash and a licence that is not allowed are refused."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
RULES = {"allowed": ["MIT", "Apache-2.0"], "exceptions": {"c": "LGPL-3.0: imported, unchanged"}}


def module() -> ModuleType:
    spec = importlib.util.spec_from_file_location("licences", ROOT / "scripts/lib/licences.py")
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


licences = module()


@pytest.mark.parametrize("path", sorted((ROOT / "scripts").glob("requirements*.txt")), ids=lambda path: path.stem)
def test_every_pinned_package_is_locked_with_hashes_in_the_version_that_is_pinned(path: Path) -> None:
    part = path.stem.removeprefix("requirements").lstrip("-") or "run"
    pins = re.findall(r"^([\w.-]+)==([\w.]+)", path.read_text(), re.MULTILINE)
    marked = r"^([\w.-]+)==([\w.]+)(?: ; [^\\\n]+)?((?: \\\n +--hash=sha256:[0-9a-f]{64})+)$"
    blocks = re.findall(marked, locked(part), re.MULTILINE)
    assert sorted((licences.normal(name), version) for name, version in pins) == sorted(
        (licences.normal(name), version) for name, version, _ in blocks
    ), "call scripts/lock"
    assert len(blocks) == len(re.findall("^[^ #\n]", locked(part), re.MULTILINE))


def locked(part: str) -> str:
    return (ROOT / "scripts/locked" / f"{part}.txt").read_text()


def test_pip_refuses_an_archive_with_another_hash(tmp_path: Path) -> None:
    archives = tmp_path / "archives"
    archives.mkdir()
    (archives / "a-1.0.tar.gz").write_bytes(b"not what was locked")
    (tmp_path / "locked.txt").write_text(f"a==1.0 --hash=sha256:{'0' * 64}\n")
    words = ["--no-deps", "--require-hashes", "--no-index", "--find-links", archives, "-r", tmp_path / "locked.txt"]
    done = subprocess.run(
        [sys.executable, "-m", "pip", "download", *words], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode != 0 and "THESE PACKAGES DO NOT MATCH THE HASHES" in done.stderr


def component(name: str, *found: str, version: str = "1") -> dict[str, Any]:
    return {"name": name, "version": version, "licenses": [{"license": {"name": licence}} for licence in found]}


@pytest.mark.parametrize(
    ("given", "refused"),
    [
        (component("a", "MIT"), False),
        (component("a", "MIT AND Apache-2.0"), False),
        (component("a", "GPL-3.0-only OR MIT"), False),
        (component("a", "MIT AND GPL-3.0-only"), True),
        (component("a", "MIT", "GPL-3.0-only"), True),
        (component("a"), True),
        (component("C", "LGPL-3.0"), False),
        (component("a", "GPL-3.0-only", version="2"), False),  # not installed by this workspace
    ],
)
def test_a_licence_that_is_not_allowed_is_refused_with_the_package(given: dict[str, Any], refused: bool) -> None:
    said = list(licences.refusals({"components": [given]}, {("a", "1"), ("c", "1")}, RULES))
    assert bool(said) is refused and all(text.startswith("a 1: ") for text in said)


def test_the_licences_of_all_pinned_packages_are_allowed_and_the_bill_of_materials_has_them() -> None:
    done = subprocess.run([sys.executable, ROOT / "scripts/lib/licences.py"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    bill = licences.BILL.read_text()
    assert '"CycloneDX"' in bill and '"mujoco"' in bill
