"""Physics plant on MuJoCo."""

import os

# For physics only: otherwise MuJoCo starts a process that looks for a window library. Renderers set MUJOCO_GL.
if "MUJOCO_GL" not in os.environ:
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco  # noqa: F401 - read now, and never again

    del os.environ["MUJOCO_GL"]
