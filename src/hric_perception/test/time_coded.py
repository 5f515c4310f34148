"""Streams that tell their own time: what a synchroniser makes of them shows the time that it took the values to be
of."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hric_perception.sync.core import SampleBatch, Synchroniser
from hric_perception.sync.layout import read_plan

NS = 1_000_000_000
START = 100.0
"""Robot time at which the streams begin [s]."""


def wave(seconds: Any) -> Any:
    """A movement as of an arm: 0.1 at 0.5 Hz."""
    return 0.1 * np.sin(np.pi * seconds)


@dataclass
class Stream:
    """A source of two values: the time of the sample [s], and a wave.

    Attributes:
        rate: [Hz].
        latency: from the sample to its arrival [s], and for the first of a chunk the chunk's length more.
        chunk: samples that arrive together.
        phase: of the first sample after `START` [s].
        silent: from when to when nothing comes, after `START` [s].
        jitter: of the latency, uniform [s].
        shift: [s] by which stamps are wrong, at a time after `START` [s].
    """

    rate: float
    latency: float = 0.003
    chunk: int = 1
    phase: float = 0.0
    silent: tuple[float, float] = (np.inf, np.inf)
    jitter: float = 0.0
    shift: Callable[[float], float] = field(default=lambda time: 0.0)

    def packets(self, seconds: float, seed: int) -> Iterator[tuple[float, Any, Any]]:
        """(arrival [s], stamps [ns], values) of each packet."""
        random = np.random.default_rng(seed)
        times = START + self.phase + np.arange(int((seconds - self.phase) * self.rate)) / self.rate
        for first in range(0, len(times) - self.chunk + 1, self.chunk):
            part = times[first : first + self.chunk]
            if self.silent[0] <= part[-1] - START < self.silent[1]:
                continue
            stamps = np.rint((part + self.shift(part[-1] - START)) * NS).astype(np.int64)
            yield (
                part[-1] + self.latency + self.jitter * random.uniform(),
                stamps,
                np.column_stack([part - START, wave(part)]),
            )


def plan(policy: str, count: int, **settings: Any) -> Any:
    """A plan of so many sources of two values; `source` are settings of each source."""
    shared = settings.pop("source", {})
    sources = [
        {"topic": f"/s{index}", "type": "hric_msgs/SampleChunk", "signals": ["data[time, wave]"], **shared}
        for index in range(count)
    ]
    return read_plan("test", {"policy": policy, "sources": sources, **settings})


def synchronise(
    plan: Any, streams: list[Stream], seconds: float, step: float = 0.005
) -> tuple[SampleBatch, Synchroniser]:
    """Let the streams arrive in the order of their arrival, and take what is due at each step [s]."""
    synchroniser = Synchroniser(plan, START)
    packets = [
        (arrival, index, stamps, values)
        for index, one in enumerate(streams)
        for arrival, stamps, values in one.packets(seconds, index)
    ]
    packets.sort(key=lambda packet: packet[0])
    batches: list[SampleBatch] = []
    now = START
    for arrival, index, stamps, values in packets:
        while now < arrival:
            now += step
            collect(synchroniser, now, batches)
        synchroniser.push(index, stamps, values, arrival)
    collect(synchroniser, now + 1.0, batches)
    return (
        (SampleBatch(*(np.concatenate(parts) for parts in zip(*batches, strict=True))), synchroniser)
        if batches
        else (empty(plan), synchroniser)
    )


def collect(synchroniser: Synchroniser, now: float, batches: list[SampleBatch]) -> None:
    """All that is due."""
    while (batch := synchroniser.take(now)) is not None:
        batches.append(batch)


def empty(plan: Any) -> SampleBatch:
    """No samples."""
    return SampleBatch(
        np.zeros(0, np.int64),
        np.zeros((0, len(plan.names))),
        np.zeros((0, len(plan.sources))),
        np.zeros((0, len(plan.sources)), bool),
    )


def skews(batch: SampleBatch) -> Any:
    """Distance from the time that each source tells to the instant [s], shape (instants, sources)."""
    return batch.values[:, 0::2] - (batch.stamps[:, None] * 1e-9 - START)
