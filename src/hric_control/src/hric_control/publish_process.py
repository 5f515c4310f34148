"""The robot process's side of its publishing process."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from hric_control.errors import HricError
from hric_control.publish_channel import PAGE_SIZE, Counters, FrameReader, frame, identity

PIPE_SIZE = 1 << 20
"""Wanted size of the pipe [bytes]; the kernel may give less."""
ANSWER_TIMEOUT = 30.0
"""Longest wait for the process to start, or to advertise [s]."""
END_TIMEOUT = 2.0
"""Longest wait for the process to end by itself [s]."""
POLL = 0.0005
"""How often a waiting drain looks at the counters [s]."""


class PublishProcess:
    """Starts the process; takes what is to be built and sent there. Its methods but `has_room`, `listeners` are for threads that may wait.

    Args:
        name, namespace: of its node.
        report: takes one line when the process has ended unasked.
    """

    def __init__(self, name: str, namespace: str, report: Callable[[str], None]) -> None:
        requests, self._out = os.pipe()
        answers, replies = os.pipe()
        page = os.memfd_create("hric_counters")
        os.ftruncate(page, PAGE_SIZE)
        self._counters = Counters(page)
        # A write never waits for the reader, a frame larger than the rest of the pipe excepted.
        self._window = _widen(self._out) // 8
        program = [sys.executable, "-m", "hric_control.publish_server", name, *map(str, (requests, replies, page))]
        environment = {**os.environ, "ROS_NAMESPACE": namespace}
        self._process = subprocess.Popen(program, pass_fds=(requests, replies, page), env=environment)
        for descriptor in (requests, replies, page):
            os.close(descriptor)
        self.name, self._report = name, report
        self._sent = 0
        self._lock = threading.Lock()
        self._topics = 0
        self._waiting = bytearray()
        self._answers: dict[int, Callable[[str], None]] = {}
        self._reports: dict[int, Callable[[str], None]] = {}
        self._told_end = False
        self._closing = False
        threading.Thread(target=self._listen, args=(answers,), name="publish answers", daemon=True).start()

    def advertise(self, topic: str, message_type: type, latch: bool, report: Callable[[str], None]) -> int:
        """Advertise; returns the number of the topic.

        Args:
            topic: absolute name.
            report: takes one line when a message could not be built or sent; from another thread.

        Raises:
            HricError: refused, or the process is gone.
        """
        with self._lock:
            number, self._topics = self._topics, self._topics + 1
        self._reports[number] = report
        self._ask(number, ("advertise", number, topic, message_type, latch))
        return number

    def unregister(self, topic: int) -> None:
        """Stop advertising, after all that was handed over before. With the process gone, does nothing."""
        if self._process.poll() is None:
            self._append(("unregister", topic))
            self.push()

    def has_room(self) -> bool:
        """Whether a message can be handed over without waiting."""
        return self._sent - self._counters.consumed < self._window

    def publish(self, topic: int, build: Callable[..., Any], args: tuple[Any, ...]) -> None:
        """Have `build(*args)` built and sent there, after the next `push`; a builder that cannot go there (a closure, a method) is called here."""
        self._append((topic, build, args) if _portable(build) else (topic, identity, (build(*args),)))

    def push(self) -> None:
        """Hand over what was published since the last time, in one write, since each wakes the other process."""
        with self._lock:
            waiting, self._waiting = self._waiting, bytearray()
            try:
                while waiting:
                    del waiting[: os.write(self._out, waiting)]
            except OSError as error:
                if self._told_end or self._closing:
                    return
                self._told_end = True
                code = self._process.poll()
                self._report(f"the publishing process {self.name} has ended ({error}; exit code {code}): nothing of this robot is published any more")

    def flush(self, timeout: float) -> bool:
        """Wait until all that was handed over is sent; False when it took longer than `timeout` [s], or the process is gone."""
        return self._wait(0, timeout)

    def make_room(self, timeout: float) -> bool:
        """Wait until a message can be handed over; False as in `flush`."""
        return self._wait(self._window - 1, timeout)

    def listeners(self, topic: int) -> int:
        """Number of listeners of a topic, a twentieth of a second old."""
        return self._counters.listeners(topic)

    def close(self, timeout: float = 2.0) -> None:
        """Send what was handed over, waiting `timeout` [s] at most, and let the process end.

        Its end, half a second later, is awaited by a thread, which the interpreter joins when it ends itself.
        """
        self._closing = True
        self.flush(timeout)
        with self._lock:
            os.close(self._out)
        threading.Thread(target=self._reap, name="publish process").start()

    def _reap(self) -> None:
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:  # it hangs at a listener
            self._process.kill()
            self._process.wait()

    def _wait(self, most: int, timeout: float) -> bool:
        self.push()
        deadline = time.monotonic() + timeout
        while self._sent - self._counters.consumed > most:
            if time.monotonic() > deadline or self._process.poll() is not None:
                return False
            time.sleep(POLL)
        return True

    def _append(self, content: Any) -> None:
        data = frame(content)
        with self._lock:
            self._sent += len(data)
            self._waiting += data

    def _ask(self, topic: int, content: tuple[Any, ...]) -> None:
        done, error = threading.Event(), [f"topic {content[2]} cannot be advertised: the publishing process {self.name} does not answer"]

        def answer(text: str) -> None:
            error[0] = text
            done.set()

        self._answers[topic] = answer
        self._append(content)
        self.push()
        deadline = time.monotonic() + ANSWER_TIMEOUT
        while not done.wait(0.1) and self._process.poll() is None and time.monotonic() < deadline:
            pass
        if error[0]:
            raise HricError(error[0])

    def _listen(self, answers: int) -> None:
        reader = FrameReader(answers)
        while (frames := reader.read()) is not None:
            for (kind, topic, text), _ in frames:
                if kind == "done":
                    self._answers.pop(topic)(text)
                else:
                    self._reports[topic](text)
        os.close(answers)


def _portable(build: Callable[..., Any]) -> bool:
    """Whether the other process finds it by its name: a function or class of a module, not a closure, lambda or bound method."""
    name = getattr(build, "__qualname__", "<")
    return "<" not in name and getattr(build, "__self__", None) is None and getattr(build, "__module__", "__main__") != "__main__"


def _widen(pipe: int) -> int:
    """Enlarge a pipe as far as an ordinary user may; returns its size [bytes]."""
    with suppress(OSError):  # the users' share of pipes may be used up; it stays as it is
        fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
    size: int = fcntl.fcntl(pipe, fcntl.F_GETPIPE_SZ)
    return size
