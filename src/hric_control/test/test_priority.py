"""The control loop's thread goes before others, where that is allowed."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from hric_control import priority


def test_only_the_thread_that_asks_goes_first() -> None:
    mine = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    def ask() -> tuple[bool, int]:
        return priority.prefer_this_thread(), os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    with ThreadPoolExecutor(1) as pool:
        allowed, its = pool.submit(ask).result()
    assert its == (priority.NICE if allowed else mine)
    assert os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) == mine


def test_where_it_is_not_allowed_that_is_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: int) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "setpriority", refuse)
    assert not priority.prefer_this_thread()
