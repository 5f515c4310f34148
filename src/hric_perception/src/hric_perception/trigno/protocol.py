"""Protocol of a Delsys Trigno server, for both sides. The data contain neither stamps nor sequence numbers."""

import re

import numpy as np

from hric_perception.chunk import FloatArray

COMMAND_PORT, EMG_PORT = 50040, 50043
"""TCP ports of commands and of EMG data; older servers send EMG on 50041."""
CHANNELS = 16
"""Number of EMG channels in every sample, including sensors that are off."""
RATE, FRAME_SAMPLES = 2000.0, 27
"""Sample rate of a server in its usual mode [Hz], and number of samples in a frame, which lasts 13.5 ms."""
SAMPLE = np.dtype("<f4")
"""Data type of one EMG value: little-endian 32 bit float [V]."""
SAMPLE_SIZE = CHANNELS * SAMPLE.itemsize
END = b"\r\n\r\n"
"""Terminator of each command and response."""
GREETING = b"Delsys Trigno System Digital Protocol Version 3.6.0" + END
FRAME_INTERVAL, FRAME_COUNT = "FRAME INTERVAL?", "MAX SAMPLES EMG?"
"""Requests for duration [s] and number of samples of a frame, which give the rate; older servers reject them."""
SENSOR = re.compile(r"SENSOR (\d+) (?:CHANNEL (\d+) )?([A-Z]+)\?")
"""Request about a sensor, or about one of its channels: number of the sensor, of the channel, and the quantity."""
AVANTI = "O"
"""Response to TYPE? of an Avanti sensor."""


CODE_PERIOD = 1.0
"""Period after which a time code starts at 0 again [s]: a 32 bit float has too few digits for more."""


def frame_samples(rate: float) -> int:
    """Return the number of samples in a frame at a sample rate [Hz], with the usual duration of a frame."""
    return max(1, round(rate * FRAME_SAMPLES / RATE))


class Encoder:
    """Encoder of EMG samples to whole frames of the Trigno protocol.

    Args:
        rate: sample rate [Hz].
        time_code: True if the last column is a time code [s].
    """

    def __init__(self, rate: float, time_code: bool) -> None:
        self._frame, self._time_code = frame_samples(rate), time_code
        self._rest = np.empty((0, CHANNELS), dtype=SAMPLE)

    @property
    def waiting(self) -> int:
        """Number of samples that do not fill a frame yet."""
        return len(self._rest)

    def encode(self, data: FloatArray) -> bytes:
        """Return the frames that these samples complete; data: EMG [V], shape (n, up to CHANNELS), padded with 0."""
        block = np.zeros((len(data), CHANNELS), dtype=SAMPLE)
        block[:, : data.shape[1]] = data
        if self._time_code:
            block[:, data.shape[1] - 1] = data[:, -1] % CODE_PERIOD
        block = np.concatenate([self._rest, block])
        complete = len(block) - len(block) % self._frame
        self._rest = block[complete:]
        return block[:complete].tobytes()

    def clear(self) -> None:
        """Discard the waiting samples."""
        self._rest = self._rest[:0]


class Decoder:
    """Decoder of bytes of the Trigno protocol to EMG samples.

    Args:
        columns: number of used channels.
    """

    def __init__(self, columns: int) -> None:
        self._columns, self._rest = columns, b""

    def decode(self, received: bytes) -> FloatArray:
        """Return the complete samples [V], shape (n, columns); bytes of an incomplete one wait for the next call."""
        received = self._rest + received
        complete = len(received) - len(received) % SAMPLE_SIZE
        self._rest = received[complete:]
        return np.frombuffer(received[:complete], SAMPLE).reshape(-1, CHANNELS)[:, : self._columns].astype(float)


def trigno_name(host: str, data_port: int) -> str:
    """Return the name by which a driver's messages refer to a Trigno server."""
    return f"trigno {host}:{data_port}"
