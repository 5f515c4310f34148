"""Installation of the package vtk when the first picture is drawn, since it takes 0.6 GB and only pictures need it."""

import importlib
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

from hric_core.errors import FailureError


def install_vtk() -> None:
    """Install vtk by scripts/setup if it is missing; the progress is printed on stderr.

    Raises:
        HricError: the installation failed, or there is no scripts/setup to run.
    """
    if importlib.util.find_spec("vtkmodules") is not None:
        return
    setup = Path(os.environ.get("HRIC_WS") or Path(__file__).resolve().parents[5]) / "scripts" / "setup"
    if not setup.is_file():
        raise FailureError("pictures need vtk, which is not installed: python3 -m pip install vtk")
    print("pictures need the package vtk, which is installed now (only once)", file=sys.stderr)
    if subprocess.run([setup, "--with", "pictures"], stdout=sys.stderr, check=False).returncode:
        raise FailureError(f"pictures need vtk, which could not be installed; try again: {setup} --with pictures")
    importlib.invalidate_caches()
