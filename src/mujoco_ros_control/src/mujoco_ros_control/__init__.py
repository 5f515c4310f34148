"""Physics plant on MuJoCo."""

import os

# Without MUJOCO_GL, MuJoCo starts a process that searches for a window library, which physics alone does not need.
# Programs that render set MUJOCO_GL themselves.
if "MUJOCO_GL" not in os.environ:
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco  # noqa: F401 - MuJoCo reads the variable at its first import only

    del os.environ["MUJOCO_GL"]
