"""The command as its users call it, for tests."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def benchmark(*words: str, path: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command; path: stands before all others in the path of Python."""
    own = [str(path)] if path else []
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([*own, os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, str(ROOT / "tests" / "benchmarks" / "table.py"), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=900, check=False, env=environment)
