"""What both sides of a Trigno connection must know. The data carry neither stamps nor numbers."""

import numpy as np

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


def trigno_name(host: str, data_port: int) -> str:
    """What the messages of the driver call a server."""
    return f"trigno {host}:{data_port}"
