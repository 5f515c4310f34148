"""Protocol of a Trigno connection, for both sides. The data contain neither stamps nor sequence numbers."""

import numpy as np

from hric_perception.chunk import FloatArray

COMMAND_PORT, EMG_PORT = 50040, 50043
"""TCP ports; older servers send EMG on 50041."""
CHANNELS = 16
"""EMG channels of every sample, sensors that are off included."""
RATE, FRAME_SAMPLES = 2000.0, 27
"""Rate of a server in its usual mode [Hz]; samples come 27 at a time, every 13.5 ms."""
SAMPLE = np.dtype("<f4")
"""Little-endian volts."""
SAMPLE_SIZE = CHANNELS * SAMPLE.itemsize
END = b"\r\n\r\n"
"""Terminator of each command and response."""
GREETING = b"Delsys Trigno System Digital Protocol Version 3.6.0" + END
FRAME_INTERVAL, FRAME_COUNT = "FRAME INTERVAL?", "MAX SAMPLES EMG?"
"""Requests for the seconds and the samples of a frame; the rate is their quotient. Older servers do not know them."""


CODE_PERIOD = 1.0
"""Period of a time code [s]: a 32 bit number holds no more digits."""


def frame_samples(rate: float) -> int:
    """Return the samples of a frame at a rate [Hz], for the frame duration of the usual mode."""
    return max(1, round(rate * FRAME_SAMPLES / RATE))


class Encoder:
    """Encoder of samples to whole frames on the wire.

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
        """Return the frames of waiting samples and these [V], shape (n, up to CHANNELS); other channels are 0."""
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
    """Decoder of bytes on the wire to samples.

    Args:
        columns: number of used channels.
    """

    def __init__(self, columns: int) -> None:
        self._columns, self._rest = columns, b""

    def decode(self, received: bytes) -> FloatArray:
        """Return the complete samples [V], shape (n, columns); bytes of an incomplete one are stored."""
        received = self._rest + received
        complete = len(received) - len(received) % SAMPLE_SIZE
        self._rest = received[complete:]
        return np.frombuffer(received[:complete], SAMPLE).reshape(-1, CHANNELS)[:, : self._columns].astype(float)


def trigno_name(host: str, data_port: int) -> str:
    """Return the name of a server in the driver's messages."""
    return f"trigno {host}:{data_port}"
