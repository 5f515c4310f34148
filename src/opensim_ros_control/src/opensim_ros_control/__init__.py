"""Physics plant on OpenSim, for the same simulated robots as the plant on PyBullet."""

import urdf_to_osim  # noqa: F401  (loads OpenSim's libraries in an order that makes it fast: urdf_to_osim.loading)
