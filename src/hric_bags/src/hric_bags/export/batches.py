"""Tables of control logs and sample chunks with one row per sample, and names for synchronised samples."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from hric_bags import reader as bag_reader
from hric_bags.export import units
from hric_bags.export.gather import Timing
from hric_bags.export.table import FloatArray, TopicColumn, TopicTable

CONTROL_LOG, CHUNK = bag_reader.LOG_TYPE, "hric_msgs/msg/SampleChunk"
SYNCED, LAYOUT = "hric_msgs/msg/SyncedSample", "hric_msgs/msg/SyncLayout"
BATCHED = (CONTROL_LOG, CHUNK)
NOT_COMMANDED = "none"
"""Type of command of a joint that no controller commands."""
_LOG_UNITS = {"position": "rad", "velocity": "rad/s", "effort": "N m"}


def table_of(
    topic: str, type_name: str, messages: Sequence[Any], timing: Timing, clock: str, prismatic: frozenset[str]
) -> TopicTable:
    """Return the table of a topic whose messages hold many samples; type_name: one of BATCHED."""
    if type_name == CONTROL_LOG:
        return control_log(topic, messages, clock, prismatic)
    return chunks(topic, messages, timing, clock)


def control_log(topic: str, messages: Sequence[Any], clock: str, prismatic: frozenset[str]) -> TopicTable:
    """Return the table of a control log with one row per control cycle, each cycle once."""
    log = bag_reader.stitch(messages)
    cycles, kinds = _cycles(log), np.array([list(message.command_interface) for message in messages])
    starts = np.maximum.accumulate([int(message.first_cycle) for message in messages])
    message_of_row = np.searchsorted(starts, cycles, "right") - 1
    columns, changing = [TopicColumn("cycle", "", cycles)], []
    for field in bag_reader.ARRAYS:
        for j, joint in enumerate(log.joint_names):
            unit, values = _LOG_UNITS.get(field, ""), getattr(log, field)[:, j]
            if not unit:
                used = {*kinds[:, j].tolist()} - {NOT_COMMANDED}
                unit = units.COMMAND_UNITS.get(used.pop(), "") if len(used) == 1 else ""
                changing += [f"{field}.{joint}"] if used else []
                if unit == units.COMMAND_UNITS["position"]:  # of an effort or velocity, 0 is no command
                    values = np.where((kinds[:, j] == NOT_COMMANDED)[message_of_row], np.nan, values)
            columns.append(TopicColumn(f"{field}.{joint}", units.of_joint(unit, joint, prismatic), values))
    first = messages[0]
    offset = bag_reader.seconds(first.header.stamp) - float(first.time[0])
    notes = [f"{count} cycles are missing from cycle {start} on" for start, count in log.gaps]
    notes += [f"the unit changes during the run: {', '.join(changing)}"] if changing else []
    stamp = np.rint((log.time + offset) * 1e9).astype(np.int64)
    return TopicTable(topic, CONTROL_LOG, "", log.time, stamp, tuple(columns), clock, tuple(notes))


def _cycles(log: bag_reader.ControlRecord) -> Any:
    numbers = log.first_cycle + np.arange(log.cycles, dtype=np.int64)
    for start, count in log.gaps:
        numbers[numbers >= start] += count
    return numbers


def chunks(topic: str, messages: Sequence[Any], timing: Timing, clock: str) -> TopicTable:
    """Return the table of sample chunks with one row per sample, at the time of its chunk plus index / rate."""
    times, stamps, numbers = [], [], []
    values: dict[str, list[FloatArray]] = {name: [] for message in messages for name in message.channels}
    for message in messages:
        width = max(len(message.channels), 1)
        block = np.asarray(message.data, dtype=float)[: len(message.data) // width * width].reshape(-1, width)
        by_channel = dict(zip(message.channels, block.T, strict=False))
        start = int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
        step = 1e9 / message.rate if message.rate > 0 else 0.0
        times.append(timing(start) + np.arange(len(block)) * step * 1e-9)
        stamps.append(start + np.rint(np.arange(len(block)) * step).astype(np.int64))
        numbers.append(int(message.first_sample) + np.arange(len(block), dtype=np.int64))
        for name, parts in values.items():
            parts.append(by_channel.get(name, np.full(len(block), np.nan)))
    stamp = np.concatenate(stamps)
    unit = _chunk_units(messages)
    columns = [TopicColumn("sample", "", np.concatenate(numbers))]
    columns += [TopicColumn(name, unit[name], np.concatenate(parts)) for name, parts in values.items()]
    missing = sum(max(0, int(b[0]) - int(a[-1]) - 1) for a, b in itertools.pairwise(numbers) if len(a) and len(b))
    rates = sorted({float(message.rate) for message in messages})
    ends = rates[:1] + rates[1:][-1:]  # lowest and highest: after lost time, there are many in between
    notes = [
        f"source {messages[0].source}",
        f"rate reported by the source: {' to '.join(f'{rate:g}' for rate in ends)} Hz",
    ]
    notes += [f"{missing} samples are missing"] if missing else []
    return TopicTable(
        topic,
        CHUNK,
        str(messages[0].header.frame_id),
        np.concatenate(times),
        stamp,
        tuple(columns),
        clock,
        tuple(notes),
    )


def _chunk_units(messages: Sequence[Any]) -> dict[str, str]:
    """Return the unit of each channel; a message has one unit for all, or one per channel separated by spaces."""
    units: dict[str, str] = {}
    for message in messages:
        words = [word.replace(".", " ") for word in str(message.unit).replace("N m", "N.m").split()]
        channel_units = words if len(words) == len(message.channels) else [str(message.unit)] * len(message.channels)
        units.update(zip(message.channels, channel_units, strict=True))
    return units


def named(table: TopicTable, layout: Any) -> TopicTable:
    """Return a table of synchronised samples with columns named as in its hric_msgs/SyncLayout."""
    names, sources = [str(name) for name in layout.names], list(dict.fromkeys(map(str, layout.sources)))
    columns = []
    for column in table.columns:
        field, _, number = column.name.partition(".")
        count = sum(other.name.startswith(f"{field}.") for other in table.columns)
        known = names if field == "values" or count == len(names) else sources
        if field not in ("values", "age", "valid") or not number.isdigit() or int(number) >= len(known):
            columns.append(column)
            continue
        label = known[int(number)]
        unit = str(layout.units[int(number)]) if field == "values" else column.unit
        columns.append(TopicColumn(label if field == "values" else f"{field}.{label}", unit, column.values))
    notes = (f"policy {layout.policy}, rate {layout.rate:g} Hz, reference {layout.reference}",)
    return TopicTable(
        table.topic, table.type_name, table.frame, table.time, table.stamp, tuple(columns), table.clock, notes
    )
