"""Who goes first when there are more threads than processors."""

from __future__ import annotations

import os
import threading

NICE = -10
"""Of the control loop's thread, 0 being everybody's: beside one that others have it gets nine tenths of a processor; our choice."""


def prefer_this_thread(nice: int = NICE) -> bool:
    """Let the calling thread, and threads it starts from now on, go before others.

    Returns:
        False where the system does not allow it: it takes root, or a line such as `@realtime - nice -10` in /etc/security/limits.conf.
    """
    try:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), nice)
    except PermissionError:
        return False
    return True
