"""Physics plant on MuJoCo."""

import os

# Loaded for its physics: else MuJoCo looks for a library of windows, by a process of its own. Who draws says MUJOCO_GL.
if "MUJOCO_GL" not in os.environ:
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco  # noqa: F401 - read now, and never again

    del os.environ["MUJOCO_GL"]
