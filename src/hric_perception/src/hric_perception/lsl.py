"""Lab Streaming Layer (LSL): a reader that reconnects to its stream, and outlets of emulated devices. No ROS."""

import contextlib
import logging
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pylsl

from hric_core.errors import FailureError, ParameterError
from hric_core.native.sockets import confine
from hric_perception.chunk import FloatArray, Layout, source_name
from hric_perception.stream import Driver, SampleStream, StreamHealth

_MACHINE = """[lab]
SessionID = {session}
KnownPeers = {{127.0.0.1}}
[multicast]
ResolveScope = machine
[log]
level = -3
"""
LOG = logging.getLogger("hric.perception.lsl")
LOOK = 0.1
"""Time between searches for a stream [s]; the constants of this file are project defaults, unconfirmed."""
POLL, LONGEST_POLL = 0.01, 0.05
"""Shortest and longest time between polls for samples [s]; in between, half the duration of a message.

Few large blocks cost less than many small ones.
"""
BUFFER = 30
"""Length of liblsl's buffer for a slow reader [s]."""
CLOCK_TIMEOUT = 5.0
"""Longest time to measure the offset of a stream's clock [s]; liblsl needs about 0.7 s."""
SAME_CLOCK = 1e-3
"""Offset below which a stream is stamped by the clock of this machine [s]."""
MAX_SAMPLES = 2048
"""Largest number of samples that one call of `pull_chunk` returns."""
SCALES = {
    **dict.fromkeys(("volts", "volt", "v"), ("V", 1.0)),
    **dict.fromkeys(("millivolts", "millivolt", "mv"), ("V", 1e-3)),
    **dict.fromkeys(("microvolts", "microvolt", "uv", "µv"), ("V", 1e-6)),
    **dict.fromkeys(("seconds", "second", "s"), ("s", 1.0)),
    **dict.fromkeys(("newtons", "newton", "n"), ("N", 1.0)),
    **dict.fromkeys(("newton meters", "newton metres", "newton-meters", "nm", "n m", "n*m"), ("N m", 1.0)),
    **dict.fromkeys(("newton millimeters", "nmm", "n mm"), ("N m", 1e-3)),
}
"""Unit in LSL's metadata, in lower case -> (SI unit, factor to it)."""
LSL_UNITS = {"V": "volts", "s": "seconds", "N": "newtons", "N m": "newton meters"}
"""SI unit -> its name in LSL's metadata."""


def use_session(session: str) -> None:
    """Restrict LSL to a session; call it before any other use of LSL in the process.

    Args:
        session: "": no restriction beyond liblsl's configuration on this machine (LSLAPICFG, lsl_api.cfg; by default
            the whole network). A name: only streams of processes on this machine with the same session name, over
            loopback only, so that other users can neither find nor read them.

    Raises:
        ParameterError: the session's name has other characters than letters, digits, _ and -, or is too long.
        FailureError: the installed liblsl cannot be restricted to loopback.
    """
    if not session:
        return
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}", session):
        raise ParameterError(f"the lsl session is {session!r}; valid: up to 60 letters, digits, _ and -, or nothing")
    if not confine("liblsl"):  # liblsl has no option for it
        raise FailureError(
            f"lsl session {session!r}: this build of liblsl cannot be restricted to loopback, as it does not import "
            "bind() of the C library; use the liblsl that scripts/setup installs, or no session"
        )
    pylsl.set_config_content(_MACHINE.format(session=session))


@dataclass(frozen=True)
class StreamQuery:
    """Criteria that select an LSL stream.

    Args:
        kind: type of the stream, e.g. "EMG"; "": any.
        name: name of the stream; "": any.
        source_id: id of the stream's device; "": any.

    Raises:
        ParameterError: no criterion, or a quotation mark, which a query cannot contain.
    """

    kind: str = ""
    name: str = ""
    source_id: str = ""

    def __post_init__(self) -> None:
        if not any((self.kind, self.name, self.source_id)):
            raise ParameterError("the lsl stream is not named; valid: a type, a name or a source_id")
        if "'" in self.kind + self.name + self.source_id:
            raise ParameterError(f"{self} contains the quotation mark '; valid: names without it")

    @property
    def query(self) -> str:
        """Query string for liblsl."""
        pairs = (("type", self.kind), ("name", self.name), ("source_id", self.source_id))
        return " and ".join(f"{key}='{value}'" for key, value in pairs if value)

    def __str__(self) -> str:
        return f"the lsl stream with {self.query}"


class LslReader(Driver):
    """Driver that reads an LSL stream, and reconnects when it is lost.

    Args:
        query: criteria for the stream.
        stream: receiver of the samples.
        health: receiver of status reports.
        choose: function that may change the layout of a stream, or reject it by a ParameterError.
        local: True if the stream is on this machine for certain, so that its clock need not be measured.
    """

    def __init__(
        self,
        query: StreamQuery,
        stream: SampleStream,
        health: StreamHealth,
        choose: Callable[[Layout], Layout] = lambda layout: layout,
        local: bool = False,
    ) -> None:
        super().__init__("lsl reader")
        self._query, self._stream, self._health, self._choose, self._local = query, stream, health, choose, local

    def _run(self) -> None:
        while streams := self._find():
            if len(streams) > 1:
                self._health.event(
                    f"several LSL streams match {self._query.query}: "
                    f"{', '.join(sorted(info.name() for info in streams))}; {streams[0].name()} is read"
                )
            try:
                self._read(streams[0])
            except RuntimeError as error:  # from liblsl: the stream was lost, or does not respond
                self._health.trouble(f"{self._query} was lost")
                LOG.warning("%s was lost: %s", self._query, error)
            except ParameterError as error:
                self._health.trouble(str(error))
                self._stop.wait(1.0)
            self._stream.end()

    def _find(self) -> list[pylsl.StreamInfo]:
        """Wait until matching streams respond, and return them; empty if the driver is closed.

        The search runs in the background, since a single one sometimes takes five seconds longer than its time-out
        (liblsl 1.18).
        """
        resolver = pylsl.ContinuousResolver(pred=self._query.query)
        while not self._stop.wait(LOOK):
            if streams := resolver.results():
                return list(streams)
            self._health.trouble(f"{self._query} is not found")
        return []

    def _read(self, info: pylsl.StreamInfo) -> None:
        flags = 0 if self._local else _clock_flags(info)
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


def _clock_flags(info: pylsl.StreamInfo) -> int:
    """Return liblsl's flags for a stream: its stamps stay as they are if they are by the clock of this machine.

    The name of the machine does not show this, since two machines or containers may have the same name. Raises
    RuntimeError if the stream does not respond.
    """
    probe = pylsl.StreamInlet(info, max_buflen=1, recover=False)
    return 0 if abs(probe.time_correction(CLOCK_TIMEOUT)) < SAME_CLOCK else int(pylsl.proc_clocksync)


def describe(info: pylsl.StreamInfo) -> tuple[Layout, FloatArray]:
    """Return the layout of an LSL stream in SI units, and the factors to these, shape (channels,).

    Raises:
        ParameterError: the stream's values are text, or it has no regular rate.
    """
    name, count, rate = info.name(), info.channel_count(), info.nominal_srate()
    if info.channel_format() == pylsl.cf_string or rate <= 0:
        raise ParameterError(
            f"the lsl stream {name} contains {'text' if rate > 0 else 'samples at no fixed rate'}; valid: numbers at "
            "a fixed rate"
        )
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


class LslOutlet:
    """Outgoing LSL stream that others can find, from construction until `close`.

    Args:
        layout: channels, units and rate; its source is the name of the stream.
        kind: type of the stream, e.g. "EMG".
        source_id: id of the device.
    """

    def __init__(self, layout: Layout, kind: str, source_id: str = "") -> None:
        info = pylsl.StreamInfo(layout.source, kind, len(layout.channels), layout.rate, pylsl.cf_double64, source_id)
        channels = info.desc().append_child("channels")
        for name, unit in zip(layout.channels, layout.units, strict=True):
            channel = channels.append_child("channel")
            channel.append_child_value("label", name)
            channel.append_child_value("unit", LSL_UNITS.get(unit, unit))
            channel.append_child_value("type", "Time" if unit == "s" else kind)
        self._outlet: pylsl.StreamOutlet | None = pylsl.StreamOutlet(info)

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Send samples.

        Args:
            times: times of the samples, monotonic clock of this machine, shape (samples,) [s].
            data: values, shape (samples, channels).
        """
        if self._outlet is not None and len(data):
            self._outlet.push_chunk(data, times.tolist())

    def close(self) -> None:
        """Close the stream, as if the device were switched off."""
        self._outlet = None
