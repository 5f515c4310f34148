"""Muscles of a simulated human whose activation sweeps, as their messages have it: each usual channel at a phase of its
own, so that whoever measures another muscle does not correlate."""

import math
from typing import Any

import numpy as np

from hric_core.robot_time import stamps
from hric_msgs.msg import MuscleActivation
from hric_perception.emg.muscles import PARTS

LEAST, GREATEST = 0.05, 0.4
"""Of the sweeps [1]."""
PERIOD = 0.005
"""Between two messages [s]."""
PHASES = {channel: 2.0 * math.pi * index / len(PARTS) for index, channel in enumerate(PARTS)}
NAMES = [f"{side}_{part}" for side in ("left", "right") for parts in PARTS.values() for part in parts] + [
    "right_infra_a"
]
LOST = [0.9, 0.1]
"""Of the muscles of the left arm and of no channel [1]."""


def sweep(channel: str, times: Any, duration: float) -> np.ndarray:
    """Activation of a channel at times [s]; duration: of a sweep up and down [s]."""
    middle, swing = 0.5 * (LEAST + GREATEST), 0.5 * (GREATEST - LEAST)
    return middle + swing * np.sin(2.0 * math.pi * np.asarray(times) / duration + PHASES[channel])


def message(time: float, duration: float) -> Any:
    """Of all muscles at a time [s]."""
    own = {f"right_{part}": float(sweep(channel, time, duration)) for channel, parts in PARTS.items() for part in parts}
    told = MuscleActivation(name=NAMES, activation=[own.get(name, LOST[name == NAMES[-1]]) for name in NAMES])
    told.header.stamp = stamps.to_time(time)
    return told


def correlations(channels: Any, times: np.ndarray, envelope: np.ndarray, duration: float, lag: float) -> list[float]:
    """Of each channel's envelope with its own sweep a lag [s] ago."""
    return [
        float(np.corrcoef(envelope[:, column], sweep(channel, times - lag, duration))[0, 1])
        for column, channel in enumerate(channels)
    ]
