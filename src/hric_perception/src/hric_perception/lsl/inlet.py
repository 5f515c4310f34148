"""Finds a stream, reads it, and finds it again when it was lost."""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pylsl

from hric_control.errors import ParameterError
from hric_perception.chunk import FloatArray, Layout
from hric_perception.health import StreamHealth
from hric_perception.stream import SampleStream

LOG = logging.getLogger("hric.perception.lsl")
RESOLVE = 0.5
"""Of one search [s]; the constants of this file are our choice."""
POLL, LONGEST_POLL = 0.01, 0.05
"""Between looks for samples, or half the duration of a message where that is longer [s]: few large blocks cost less than many small ones."""
BUFFER = 30
"""Seconds that liblsl keeps for a reader that is late."""
MAX_SAMPLES = 2048
"""Of one pull."""
SCALES = {
    **dict.fromkeys(("volts", "volt", "v"), ("V", 1.0)),
    **dict.fromkeys(("millivolts", "millivolt", "mv"), ("V", 1e-3)),
    **dict.fromkeys(("microvolts", "microvolt", "uv", "µv"), ("V", 1e-6)),
    **dict.fromkeys(("seconds", "second", "s"), ("s", 1.0)),
    **dict.fromkeys(("newtons", "newton", "n"), ("N", 1.0)),
    **dict.fromkeys(("newton meters", "newton metres", "newton-meters", "nm", "n m", "n*m"), ("N m", 1.0)),
    **dict.fromkeys(("newton millimeters", "nmm", "n mm"), ("N m", 1e-3)),
}
"""Units of LSL's meta-data, lower case -> (unit here, factor)."""


@dataclass(frozen=True)
class Wanted:
    """Which stream.

    Args:
        kind: its type, e.g. "EMG"; "": any.
        name: its name; "": any.
        source_id: of its device; "": any.

    Raises:
        ParameterError: nothing is given, or a quotation mark, which a query cannot hold.
    """

    kind: str = ""
    name: str = ""
    source_id: str = ""

    def __post_init__(self) -> None:
        if not any((self.kind, self.name, self.source_id)):
            raise ParameterError("no lsl stream is asked for; valid: a type, a name or a source_id")
        if "'" in self.kind + self.name + self.source_id:
            raise ParameterError(f"{self}: valid: no quotation marks")

    @property
    def query(self) -> str:
        """For liblsl."""
        pairs = (("type", self.kind), ("name", self.name), ("source_id", self.source_id))
        return " and ".join(f"{key}='{value}'" for key, value in pairs if value)

    def __str__(self) -> str:
        return f"the lsl stream with {self.query}"


class LslReader:
    """Reads in a thread of its own from `start` on. Use `close`.

    Args:
        wanted: which stream.
        stream: gets the samples.
        health: is told of trouble.
        choose: may change the layout of a stream that was found, or refuse it by a ParameterError.
    """

    def __init__(
        self, wanted: Wanted, stream: SampleStream, health: StreamHealth, choose: Callable[[Layout], Layout] = lambda layout: layout
    ) -> None:
        self._wanted, self._stream, self._health, self._choose = wanted, stream, health, choose
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="lsl reader", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End."""
        self._stop.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._stop.is_set():
            found = pylsl.resolve_bypred(self._wanted.query, 1, RESOLVE)
            if not found:
                self._health.trouble(f"{self._wanted} is not there")
                continue
            if len(found) > 1:
                names = ", ".join(sorted(info.name() for info in found))
                self._health.event(f"several streams are {self._wanted}: {names}; the first is read")
            try:
                self._read(found[0])
            except RuntimeError as error:  # what liblsl reports: the stream was lost, or does not answer
                self._health.trouble(f"{self._wanted} was lost")
                LOG.warning("%s was lost: %s", self._wanted, error)
            except ParameterError as error:
                self._health.trouble(str(error))
                self._stop.wait(1.0)
            self._stream.end()

    def _read(self, info: pylsl.StreamInfo) -> None:
        # The clock of this machine is the one that its own streams are stamped by: nothing to estimate.
        flags = 0 if info.hostname() == socket.gethostname() else pylsl.proc_clocksync
        inlet = pylsl.StreamInlet(info, max_buflen=BUFFER, recover=False, processing_flags=flags)
        try:
            layout, scales = describe(inlet.info(2.0))
            self._stream.begin(self._choose(layout))
            LOG.info("%s: %s at %g Hz", layout.source, ", ".join(layout.channels), layout.rate)
            inlet.open_stream(2.0)
            poll = min(max(POLL, self._stream.duration / 2), LONGEST_POLL)
            while not self._stop.wait(poll):
                data, times = inlet.pull_chunk(0.0, MAX_SAMPLES, as_numpy=True)
                if len(times):
                    self._stream.stamped(np.asarray(times, dtype=float), np.asarray(data, dtype=float) * scales)
        finally:
            with contextlib.suppress(RuntimeError):
                inlet.close_stream()


def source_name(kind: str, name: str) -> str:
    """What the messages of a driver call a stream, by its type and name."""
    return f"lsl {kind} {name}"


def describe(info: pylsl.StreamInfo) -> tuple[Layout, FloatArray]:
    """Layout of a stream, and factors to its units, shape (channels,).

    Raises:
        ParameterError: it holds no numbers or has no regular rate.
    """
    name, count, rate = info.name(), info.channel_count(), info.nominal_srate()
    if info.channel_format() == pylsl.cf_string or rate <= 0:
        raise ParameterError(f"the lsl stream {name} holds {'text' if rate > 0 else 'samples at no fixed rate'}; valid: numbers at a fixed rate")
    labels, units, scales = [], [], []
    channel = info.desc().child("channels").child("channel")
    for index in range(count):
        unit = channel.child_value("unit")
        known, scale = SCALES.get(unit.lower(), (unit, 1.0))
        labels.append(channel.child_value("label") or f"channel{index + 1}")
        units.append(known)
        scales.append(scale)
        channel = channel.next_sibling("channel")
    return Layout(source_name(info.type(), name), tuple(labels), tuple(units), rate), np.array(scales)
