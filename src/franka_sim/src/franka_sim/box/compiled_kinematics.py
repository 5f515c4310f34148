"""Kinematics of each millisecond by compiled code, where there is a compiler; kinematics, pose_lists and newton say the same in Python."""

from __future__ import annotations

import functools
import logging
from pathlib import Path
from typing import Any

from hric_control.errors import HricError
from hric_control.extension import load_extension

SOURCE = Path(__file__).with_name("kinematics.c")
LOG = logging.getLogger("hric.franka_sim")


@functools.cache
def compiled() -> Any:
    """The module of kinematics.c; None where it cannot be compiled, which is said."""
    try:
        return load_extension(SOURCE.read_text(), "hric_kinematics")
    except HricError as error:
        LOG.info("the arm's kinematics are computed without compiled code, which takes longer: %s", error)
        return None
