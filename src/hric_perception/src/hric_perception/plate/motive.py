"""An emulated Motive that has nothing but a force plate. No ROS."""

from __future__ import annotations

import numpy as np

from hric_control.errors import HricError, ParameterError
from hric_perception.emulation import BlockNoise, Faults
from hric_perception.plate.loads import Load
from hric_perception.section import Section
from mocap_natnet.poses import UP_AXES
from mocap_natnet.server import Motive, MotiveServer, Plate, Scene, Settings
from mocap_natnet.server.stream_time import Clock

CODE_PERIOD = 1.0
"""A time code counts within a second: a 32 bit number holds no more digits [s]."""


class PlateMotive:
    """Streams from its construction on. Use `close`.

    Args:
        section: how: `rate` of frames [Hz], `ip`, `command_port`, `data_port`, `transport`, `up_axis`, `latency` [s], `loss`, `centre` [m].
        rate: of the plate, a multiple of that of the frames [Hz].
        load: what presses.
        faults: noise, bias and time code (in Mz) count, the others are those of Motive.
        clock: by which it goes.

    Raises:
        HricError: a value that cannot be, or the port is taken.
    """

    def __init__(self, section: Section, rate: float, load: Load, faults: Faults, clock: Clock) -> None:
        section.only("rate", "ip", "command_port", "data_port", "transport", "up_axis", "latency", "loss", "centre")
        base = Settings()
        frames = section.number("rate", 200.0, 1.0, 1000.0)
        count = round(rate / frames)
        if count < 1 or abs(count * frames - rate) > 1e-6 * rate:
            raise ParameterError(f"{section.where}.rate is {frames:g} Hz for a plate of {rate:g} Hz; valid: a whole number of samples per frame")
        try:
            settings = Settings(
                rate=frames,
                ip=section.text("ip", base.ip),
                command_port=section.whole("command_port", base.command_port, 0, 65535),
                data_port=section.whole("data_port", base.data_port, 1, 65535),
                transport=section.text("transport", "unicast"),
                latency=section.number("latency", base.latency, 0.0, 1.0),
                loss=section.number("loss", 0.0, 0.0, 1.0),
                seed=faults.seed,
            )
        except HricError as error:
            text = str(error)
            raise ParameterError(text if text.startswith(section.where) else f"{section.where}: {text}") from error
        self._rate, self._load, self._faults, self._noise = rate, load, faults, BlockNoise(6, faults.seed)
        plate = Plate(self._sample, centre=section.vector("centre", (0.0, 0.0, 0.0)), samples=count)
        self.server = MotiveServer(Motive(settings, Scene((), (plate,), up=section.text("up_axis", "y", UP_AXES))), clock)
        self.server.start()

    def close(self) -> None:
        """End."""
        self.server.close()

    def _sample(self, time: float) -> tuple[float, ...]:
        """What the plate measures at a time of the stream [s]."""
        run, faults = self.server.run_time(time), self._faults
        run = time if run is None else run
        values = self._load(np.array([run]))[0] + faults.bias
        if faults.noise:
            values = values + faults.noise * self._noise.values(max(0, round(time * self._rate)), 1)[0]
        if faults.time_code:
            values[5] = run % CODE_PERIOD
        return tuple(values.tolist())
