"""Messages of a simulated human's muscles whose activation sweeps up and down, each default channel with its own phase.

An envelope measured at another muscle therefore does not correlate.
"""

import math
from typing import Any

import numpy as np

from hric_core.robot_time import stamps
from hric_msgs.msg import MuscleActivation
from hric_perception.emg.muscles import PARTS

LEAST, GREATEST = 0.05, 0.4
"""Smallest and largest activation of the sweeps [1]."""
PERIOD = 0.005
"""Time between two messages [s]."""
PHASES = {channel: 2.0 * math.pi * index / len(PARTS) for index, channel in enumerate(PARTS)}
NAMES = [f"{side}_{part}" for side in ("left", "right") for parts in PARTS.values() for part in parts] + [
    "right_infra_a"
]
LOST = [0.9, 0.1]
"""Constant activation of the left arm's muscles, and of a muscle without a channel [1]."""


def sweep(channel: str, times: Any, duration: float) -> np.ndarray:
    """Return the activation of a channel at times [s]; duration: time of one sweep up and down [s]."""
    middle, swing = 0.5 * (LEAST + GREATEST), 0.5 * (GREATEST - LEAST)
    return middle + swing * np.sin(2.0 * math.pi * np.asarray(times) / duration + PHASES[channel])


def message(time: float, duration: float) -> Any:
    """Return the hric_msgs/MuscleActivation of all muscles at a time [s]."""
    own = {f"right_{part}": float(sweep(channel, time, duration)) for channel, parts in PARTS.items() for part in parts}
    told = MuscleActivation(name=NAMES, activation=[own.get(name, LOST[name == NAMES[-1]]) for name in NAMES])
    told.header.stamp = stamps.to_time(time)
    return told


def correlations(channels: Any, times: np.ndarray, envelope: np.ndarray, duration: float, lag: float) -> list[float]:
    """Return the correlation of each channel's envelope with the channel's sweep `lag` [s] earlier."""
    return [
        float(np.corrcoef(envelope[:, column], sweep(channel, times - lag, duration))[0, 1])
        for column, channel in enumerate(channels)
    ]
