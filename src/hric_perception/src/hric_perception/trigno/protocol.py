"""What both sides of a Trigno connection must know. The data carry neither stamps nor numbers."""

import numpy as np

from hric_perception.chunk import FloatArray

COMMAND_PORT, EMG_PORT = 50040, 50043
"""TCP; older servers send EMG on 50041."""
CHANNELS = 16
"""EMG channels of every sample, sensors that are off included."""
RATE, FRAME_SAMPLES = 2000.0, 27
"""Of a server in its usual mode [Hz]; samples come 27 at a time, every 13.5 ms."""
SAMPLE = np.dtype("<f4")
"""Little-endian volts."""
SAMPLE_SIZE = CHANNELS * SAMPLE.itemsize
END = b"\r\n\r\n"
"""Of each command and response."""
GREETING = b"Delsys Trigno System Digital Protocol Version 3.6.0" + END
FRAME_INTERVAL, FRAME_COUNT = "FRAME INTERVAL?", "MAX SAMPLES EMG?"
"""Requests for the seconds and the samples of a frame; the rate is their quotient. Older servers do not know them."""


CODE_PERIOD = 1.0
"""A time code counts within a second: a 32 bit number holds no more digits [s]."""


def frame_samples(rate: float) -> int:
    """Samples of a frame at a rate [Hz]: those of the usual mode's duration."""
    return max(1, round(rate * FRAME_SAMPLES / RATE))


class Encoder:
    """Samples to what is on the wire, in whole frames.

    Args:
        rate: of samples [Hz].
        time_code: whether the last column is a time code [s].
    """

    def __init__(self, rate: float, time_code: bool) -> None:
        self._frame, self._time_code = frame_samples(rate), time_code
        self._rest = np.empty((0, CHANNELS), dtype=SAMPLE)

    @property
    def waiting(self) -> int:
        """Samples that do not fill a frame yet."""
        return len(self._rest)

    def encode(self, data: FloatArray) -> bytes:
        """Samples [V], shape (n, up to CHANNELS), others are 0; and what waited."""
        block = np.zeros((len(data), CHANNELS), dtype=SAMPLE)
        block[:, : data.shape[1]] = data
        if self._time_code:
            block[:, data.shape[1] - 1] = data[:, -1] % CODE_PERIOD
        block = np.concatenate([self._rest, block])
        whole = len(block) - len(block) % self._frame
        self._rest = block[whole:]
        return block[:whole].tobytes()

    def clear(self) -> None:
        """Nothing waits."""
        self._rest = self._rest[:0]


class Decoder:
    """What is on the wire to samples.

    Args:
        columns: how many of the channels are used.
    """

    def __init__(self, columns: int) -> None:
        self._columns, self._rest = columns, b""

    def decode(self, received: bytes) -> FloatArray:
        """All whole samples [V], shape (n, columns); bytes of a part of one wait."""
        received = self._rest + received
        whole = len(received) - len(received) % SAMPLE_SIZE
        self._rest = received[whole:]
        return np.frombuffer(received[:whole], SAMPLE).reshape(-1, CHANNELS)[:, : self._columns].astype(float)


def trigno_name(host: str, data_port: int) -> str:
    """What the messages of the driver call a server."""
    return f"trigno {host}:{data_port}"
