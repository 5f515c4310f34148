"""What an emulated device sends over LSL."""

from __future__ import annotations

import pylsl

from hric_perception.chunk import FloatArray, Layout

LSL_UNITS = {"V": "volts", "s": "seconds", "N": "newtons", "N m": "newton meters"}
"""Units as LSL's meta-data call them."""


class LslOutlet:
    """A stream that others can find, from its construction until `close`.

    Args:
        layout: channels, units and rate; its source is the name of the stream.
        kind: its type, e.g. "EMG".
        source_id: of the device.
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
            times: when each was taken, monotonic clock of this machine, shape (samples,) [s].
            data: shape (samples, channels).
        """
        if self._outlet is not None and len(data):
            self._outlet.push_chunk(data, times.tolist())

    def close(self) -> None:
        """The device is switched off."""
        self._outlet = None
