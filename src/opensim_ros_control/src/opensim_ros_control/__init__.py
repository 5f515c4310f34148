"""Physics plant on OpenSim, for the same simulated robots as the one on PyBullet."""

import urdf_to_osim  # noqa: F401  (loads OpenSim such that it runs at its own speed: see urdf_to_osim.loading)
