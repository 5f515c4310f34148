"""Software bill of materials of the Python environment, and check of the licences of all pinned packages.

``python3 scripts/lib/licences.py`` writes build/sbom.cdx.json (CycloneDX), and ends with exit code 1 if the licence of
a package is neither allowed nor listed as an exception in pyproject.toml, [tool.hric.licences]. Debian packages are not
checked.
"""

import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

WORKSPACE = Path(__file__).resolve().parents[2]
BILL = WORKSPACE / "build/sbom.cdx.json"
Content = Mapping[str, Any]
"""Bill of materials (CycloneDX) or a component of it, or the table [tool.hric.licences] of pyproject.toml."""
_PINNED = re.compile(r"^([\w.-]+)==([\w.]+)", re.MULTILINE)


def normal(name: str) -> str:
    """Return the normalised name of a package (PEP 503)."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned() -> set[tuple[str, str]]:
    """Return name and version of each package that scripts/setup installs."""
    files = (WORKSPACE / "scripts/locked").glob("*.txt")
    return {(normal(name), version) for path in files for name, version in _PINNED.findall(path.read_text())}


def bill() -> Content:
    """Write the bill of materials of the environment and return it."""
    BILL.parent.mkdir(exist_ok=True)
    tool = [sys.executable, "-m", "cyclonedx_py", "environment", "--no-validate", "--output-reproducible"]
    command = [*tool, "--of", "JSON", "-o", str(BILL), sys.executable]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    content: Content = json.loads(BILL.read_text())
    return content


def licences(component: Content) -> list[str]:
    """Return the licences of a component of the bill of materials: SPDX expressions, SPDX ids, or classifier names."""
    entries = component.get("licenses", [])
    return [entry.get("expression") or entry["license"].get("id") or entry["license"]["name"] for entry in entries]


def refusals(content: Content, installed: set[tuple[str, str]], rules: Content) -> Iterator[str]:
    """Yield a message for each installed package whose licence the rules do not allow.

    Args:
        content: bill of materials.
        installed: names and versions to check.
        rules: table with the keys allowed (licence expressions) and exceptions (licence and reason by package).
    """
    allowed, exceptions = set(rules["allowed"]), rules["exceptions"]
    for component in content["components"]:
        name, names = normal(component["name"]), licences(component)
        if (name, component["version"]) not in installed or name in exceptions:
            continue
        if not names or not all(_permits(licence, allowed) for licence in names):
            listed = ", ".join(names) or "no licence in its metadata"
            yield f"{component['name']} {component['version']}: {listed}; valid: an allowed licence, or an exception"


def _permits(expression: str, allowed: set[str]) -> bool:
    """Return True if an alternative (OR) of a licence expression contains allowed licences only."""
    alternatives = expression.split(" OR ")
    return any(all(part in allowed for part in alternative.split(" AND ")) for alternative in alternatives)


def main() -> int:
    """Write the bill of materials, check its licences, and return the exit code."""
    rules = tomllib.loads((WORKSPACE / "pyproject.toml").read_text())["tool"]["hric"]["licences"]
    problems = list(refusals(bill(), pinned(), rules))
    print("\n".join([*problems, f"bill of materials: {BILL}"]))
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
