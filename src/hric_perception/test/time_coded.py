"""Streams whose values are the time of their samples, so that synchronised values show which time they are of."""

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
    """Return a motion similar to that of an arm: amplitude 0.1, 0.5 Hz."""
    return 0.1 * np.sin(np.pi * seconds)


@dataclass
class Stream:
    """A source of two values: the time of the sample [s], and a wave.

    Attributes:
        rate: sample rate [Hz].
        latency: time from the last sample of a chunk to its arrival [s].
        chunk: number of samples that arrive together.
        phase: time of the first sample after `START` [s].
        silent: begin and end of a time without samples, after `START` [s].
        jitter: largest random addition to the latency [s].
        shift: function from a time after `START` [s] to the error of stamps [s].
    """

    rate: float
    latency: float = 0.003
    chunk: int = 1
    phase: float = 0.0
    silent: tuple[float, float] = (np.inf, np.inf)
    jitter: float = 0.0
    shift: Callable[[float], float] = field(default=lambda time: 0.0)

    def packets(self, seconds: float, seed: int) -> Iterator[tuple[float, Any, Any]]:
        """Yield (arrival [s], stamps [ns], values) of each packet."""
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
    """Return a plan of `count` sources with two values each; `source` in settings: settings of each source."""
    shared = settings.pop("source", {})
    sources = [
        {"topic": f"/s{index}", "type": "hric_msgs/SampleChunk", "signals": ["data[time, wave]"], **shared}
        for index in range(count)
    ]
    return read_plan("test", {"policy": policy, "sources": sources, **settings})


def synchronise(
    plan: Any, streams: list[Stream], seconds: float, step: float = 0.005
) -> tuple[SampleBatch, Synchroniser]:
    """Pass packets of all streams to a synchroniser in order of arrival, and return all synchronised samples."""
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
    """Append all batches that are due."""
    while (batch := synchroniser.take(now)) is not None:
        batches.append(batch)


def empty(plan: Any) -> SampleBatch:
    """Return a batch without samples."""
    return SampleBatch(
        np.zeros(0, np.int64),
        np.zeros((0, len(plan.names))),
        np.zeros((0, len(plan.sources))),
        np.zeros((0, len(plan.sources)), bool),
    )


def skews(batch: SampleBatch) -> Any:
    """Return the time in each source's value minus the instant [s], shape (instants, sources)."""
    return batch.values[:, 0::2] - (batch.stamps[:, None] * 1e-9 - START)
