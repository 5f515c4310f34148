"""Call of the benchmark command (tests/benchmarks/table.py) for tests."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def benchmark(*words: str, path: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run the benchmark command; `path` is put first in PYTHONPATH."""
    own = [str(path)] if path else []
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([*own, os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, str(ROOT / "tests" / "benchmarks" / "table.py"), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=900, check=False, env=environment)
