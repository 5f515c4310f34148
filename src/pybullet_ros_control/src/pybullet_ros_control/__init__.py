"""Physics plant on PyBullet, and a generic simulated robot for any URDF with transmissions."""

import contextlib
import os
from collections.abc import Iterator


@contextlib.contextmanager
def _without_banner() -> Iterator[None]:
    """Suppress the build time that PyBullet prints on stderr at each import."""
    stderr_copy, null_device = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null_device, 2)
    try:
        yield
    finally:
        os.dup2(stderr_copy, 2)
        os.close(stderr_copy)
        os.close(null_device)


with _without_banner():
    import pybullet  # noqa: F401
