"""What the sections `emg`, `force_plate` and `sync` tell: which sensors run beside the robot, and at which rates all come together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

EMG_KEYS = ("channels", "chunk", "device", "emulated", "envelope", "lsl", "rate", "transport", "trigno")
PLATE_KEYS = ("calibration", "chunk", "device", "emulated", "height", "id", "invert", "lsl", "natnet", "pose", "rate", "size", "transport")
SYNC_KEYS = ("delay", "rates")
EMULATED, REAL, NONE = "emulated", "real", "none"
DEVICES = (EMULATED, REAL, NONE)
EMG_TRANSPORTS, PLATE_TRANSPORTS = ("lsl", "trigno"), ("lsl", "natnet")
LSL_KEYS = ("name", "session", "source_id", "type")
TRIGNO_KEYS = ("command_port", "data_port", "host", "latency")
NATNET_KEYS = ("base_frame", "base_from_mocap", "bitstream", "command_port", "data_port", "group", "local", "plate", "server", "transport", "up_axis")
CHUNK = 0.05
"""Duration of a message [s]: a few large ones cost less than many small ones (our choice)."""
RATES = (100.0, 1000.0)
DELAY = 1.0
"""A busy machine may hold a sensor's process back for a while, and nothing here is in a hurry (our choice) [s]."""
MOST_CHANNELS = 64
PLATE_SIZE = (0.6, 0.4)
"""Of the surface of a force plate along x and y, that of the emulated one [m] (default chosen by this project, unconfirmed)."""


@dataclass(frozen=True)
class SensorSpec:
    """A sensor that samples evenly.

    Attributes:
        device: emulated, real (what emulates is left out), or none.
        transport: how it is heard.
        channels: names.
        rate: of the emulated one [Hz].
        chunk: duration of a message [s].
        driver: further parameters of the driver node.
        emulated: of the emulated device: what it measures, `faults`.
        described: what nothing here needs, but files for others tell: of a plate `size`, `calibration`.
    """

    device: str
    transport: str
    channels: tuple[str, ...]
    rate: float
    chunk: float
    driver: Mapping[str, Any] = field(default_factory=dict)
    emulated: Mapping[str, Any] = field(default_factory=dict)
    described: Mapping[str, Any] = field(default_factory=dict)

    @property
    def used(self) -> bool:
        """Whether it runs."""
        return self.device != NONE

    @property
    def time_code(self) -> bool:
        """Whether a channel tells the run time of each sample."""
        return self.device == EMULATED and bool((self.emulated.get("faults") or {}).get("time_code", False))


@dataclass(frozen=True)
class SyncSpec:
    """What brings all sources together.

    Attributes:
        rates: of the streams, one each [Hz].
        delay: how long an instant waits for a source that is late [s].
    """

    rates: tuple[float, ...] = RATES
    delay: float = DELAY
