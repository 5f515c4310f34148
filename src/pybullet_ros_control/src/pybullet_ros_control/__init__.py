"""Physics plant on PyBullet, and a generic simulated robot for any URDF with transmissions."""
