"""Physics plant on OpenSim, for the same simulated robots as the plant on PyBullet."""

import urdf_to_osim  # noqa: F401  (loads OpenSim so that it runs at full speed: see urdf_to_osim.loading)
