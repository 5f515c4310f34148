"""Writer of a trial as an XDF file, the format of Lab Streaming Layer's recorder, with its metadata of channels."""

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from hric_bags.export.table import FloatArray
from hric_bags.export.trial.c3d_format import force_platform
from hric_bags.export.trial.c3d_trial import C3dTrial, Channel

HEADER, STREAM, SAMPLES, CLOCK_OFFSET, FOOTER = 1, 2, 3, 4, 6
"""Tags of chunks in an XDF file."""
BLOCK = 4096
"""Largest number of samples in a chunk."""
UNITS = {"V": "volts", "mV": "millivolts", "uV": "microvolts", "N": "newtons", "Nmm": "newton millimeters"}
"""Unit -> its name in the metadata of Lab Streaming Layer."""


class _XdfFile:
    """XDF file in memory, to which streams are added."""

    def __init__(self, about: Mapping[str, object]) -> None:
        self.content, self._streams = b"XDF:", 0
        hric = escape(json.dumps(about))
        self._chunk(HEADER, f"<?xml version='1.0'?><info><version>1.0</version><hric>{hric}</hric></info>".encode())

    def add(self, name: str, kind: str, rate: float, channels: Sequence[dict[str, str]], text: bool = False) -> int:
        """Start a stream with these metadata of its channels, and return its number; rate: [Hz], 0: irregular."""
        self._streams += 1
        described = "".join(
            f"<channel>{''.join(f'<{key}>{escape(value)}</{key}>' for key, value in channel.items())}</channel>"
            for channel in channels
        )
        head = f"""<?xml version='1.0'?><info><name>{escape(name)}</name><type>{kind}</type>
<channel_count>{len(channels)}</channel_count><nominal_srate>{rate:.12g}</nominal_srate>
<channel_format>{"string" if text else "double64"}</channel_format><source_id>hric {escape(name)}</source_id>
<desc><channels>{described}</channels></desc></info>"""
        self._chunk(STREAM, head.encode(), self._streams)
        return self._streams

    def samples(self, stream: int, times: FloatArray, rows: Sequence[bytes]) -> None:
        """Add all samples of a stream, each with its time [s], and its end."""
        for first in range(0, len(rows), BLOCK):
            stamped = zip(times[first : first + BLOCK], rows[first : first + BLOCK], strict=True)
            block = [struct.pack("<Bd", 8, time) + row for time, row in stamped]
            self._chunk(SAMPLES, struct.pack("<BI", 4, len(block)) + b"".join(block), stream)
        ends = float(times[0]), float(times[-1])
        for time in ends:  # all streams are on the clock of the file
            self._chunk(CLOCK_OFFSET, struct.pack("<dd", time, 0.0), stream)
        foot = (
            f"<?xml version='1.0'?><info><first_timestamp>{ends[0]!r}</first_timestamp><last_timestamp>{ends[1]!r}"
            f"</last_timestamp><sample_count>{len(rows)}</sample_count></info>"
        )
        self._chunk(FOOTER, foot.encode(), stream)

    def _chunk(self, tag: int, content: bytes, stream: int | None = None) -> None:
        number = b"" if stream is None else struct.pack("<I", stream)
        self.content += struct.pack("<BQH", 8, 2 + len(number) + len(content), tag) + number + content


def write_xdf(path: Path, trial: C3dTrial) -> None:
    """Write markers, force plates, EMG and events as streams; times are those of the tables, on the clock of the run.

    Args:
        path: file to write.
        trial: trial with its channels of force plates first, six each.
    """
    plates = {name: values.tolist() for name, values in force_platform(trial).items()} if trial.plates else {}
    file = _XdfFile({"up": trial.up, "length": trial.length, "force_platform": plates})
    times = trial.start + np.arange(len(trial.positions)) / trial.rate
    if trial.labels:
        markers = [
            {"label": f"{label}_{axis}", "marker": label, "unit": "meters", "type": f"Position{axis}"}
            for label in trial.labels
            for axis in "XYZ"
        ]
        positions = trial.positions.reshape(len(times), -1).astype("<f8")
        file.samples(file.add("markers", "MoCap", trial.rate, markers), times, [row.tobytes() for row in positions])
    rate, split = trial.rate * trial.per_frame, 6 * len(trial.plates)
    for kind, channels in (("Force", trial.channels[:split]), ("EMG", trial.channels[split:])):
        if channels:
            stream = file.add(kind.lower(), kind, rate, [_described(channel, kind) for channel in channels])
            rows = np.stack([channel.values for channel in channels], axis=1).astype("<f8")
            file.samples(stream, trial.start + np.arange(len(rows)) / rate, [row.tobytes() for row in rows])
    if trial.events:
        stream = file.add("events", "Markers", 0.0, [{"label": "event", "type": "Marker"}], text=True)
        words = [f"{label} ({context})".encode() for _, label, context in trial.events]
        rows_of_text = [struct.pack("<BI", 4, len(word)) + word for word in words]
        file.samples(stream, trial.start + np.array([event.time for event in trial.events]), rows_of_text)
    path.write_bytes(file.content)


def _described(channel: Channel, kind: str) -> dict[str, str]:
    return {"label": channel.label, "unit": UNITS.get(channel.unit, channel.unit), "type": kind}
