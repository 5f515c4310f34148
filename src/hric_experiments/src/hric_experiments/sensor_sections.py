"""The sections `mocap`, `emg`, `force_plate` and `sync` of an experiment file, checked."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hric_control.errors import ParameterError
from hric_experiments.mocap_spec import read_mocap
from hric_experiments.sensor_spec import (
    CHUNK,
    DELAY,
    DEVICES,
    EMG_KEYS,
    EMG_TRANSPORTS,
    EMULATED,
    LSL_KEYS,
    MOST_CHANNELS,
    NATNET_KEYS,
    PLATE_KEYS,
    PLATE_SIZE,
    PLATE_TRANSPORTS,
    RATES,
    SYNC_KEYS,
    TRIGNO_KEYS,
    SensorSpec,
    SyncSpec,
)
from hric_perception import replayed
from hric_perception.emg.activation import AMPLITUDE, MUSCLES, read_program
from hric_perception.emg.activation import PROGRAMS as ACTIVATIONS
from hric_perception.emg.settings import read_settings
from hric_perception.emulation import read_faults
from hric_perception.plate.geometry import read_place
from hric_perception.plate.loads import PROGRAMS as LOADS
from hric_perception.plate.loads import read_load
from hric_perception.section import Section
from mocap_natnet.trial import PROGRAM as RECORDED


def read_emg(raw: Any) -> SensorSpec:
    """Check the section `emg`.

    Raises:
        HricError: an unknown key or a value that cannot be; names the key and what is valid.
    """
    section = Section("emg", copy.deepcopy(raw))
    section.only(*EMG_KEYS)
    channels = _channels(section)
    read_settings(section.section("envelope"))
    emulated = section.section("emulated")
    emulated.only("activation", "amplitude", "faults")
    emulated.number("amplitude", AMPLITUDE, 0.0, 1.0)
    activation = emulated.section("activation")
    program = activation.text("program", "bursts", ACTIVATIONS)
    if program == RECORDED:
        replayed.read_emg(activation, channels)
    elif program != "topic":
        read_program(activation, channels)
    section.section("trigno").only(*TRIGNO_KEYS)
    return _sensor(section, channels, EMG_TRANSPORTS, 2000.0, 100.0, ("envelope", "lsl", "trigno"))


def read_plate(raw: Any) -> SensorSpec:
    """Check the section `force_plate`.

    Raises:
        HricError: an unknown key or a value that cannot be; names the key and what is valid.
    """
    section = Section("force_plate", copy.deepcopy(raw))
    section.only(*PLATE_KEYS)
    name = section.text("id", "1")
    if not name.replace("_", "").isalnum() or not name.isascii():
        raise ParameterError(f"force_plate.id is {name!r}; valid: letters, digits and _")
    section.number("height", 0.0)
    if not isinstance(section.content.get("invert", False), bool):
        raise ParameterError(f"force_plate.invert is {section.content['invert']!r}; valid: true or false")
    section.section("natnet").only(*NATNET_KEYS)
    read_place(section.section("pose"))
    emulated = section.section("emulated")
    emulated.only("faults", "load", "natnet")
    load = emulated.section("load")
    program = load.text("program", "push", LOADS)
    if program == RECORDED:
        replayed.read_load(load)
    elif program != "contacts":
        read_load(load)
    section.content["id"] = name
    channels = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    spec = _sensor(section, channels, PLATE_TRANSPORTS, 1000.0, 10.0, ("id", "height", "invert", "pose", "lsl", "natnet"))
    return replace(spec, described=_described(section))


def _described(section: Section) -> dict[str, Any]:
    """What a c3d file tells of the plate."""
    size = Section.numbers("force_plate.size", section.content.get("size", list(PLATE_SIZE)), (2,))
    if min(size) <= 0:
        raise ParameterError(f"force_plate.size is {size}; valid: two numbers above 0 [m]")
    if section.content.get("calibration") is None:
        return {"size": size}
    rows = section.rows("calibration", 6)
    if len(rows) != 6 or np.linalg.matrix_rank(rows) < 6:
        raise ParameterError(f"force_plate.calibration has {len(rows)} rows; valid: six rows of six numbers that can be inverted [N/V, N m/V]")
    return {"size": size, "calibration": rows}


def read_sync(raw: Any) -> SyncSpec:
    """Check the section `sync`.

    Raises:
        HricError: an unknown key or a value that cannot be; names the key and what is valid.
    """
    section = Section("sync", raw)
    section.only(*SYNC_KEYS)
    given = section.content.get("rates", list(RATES))
    rates = tuple(Section.numbers("sync.rates", given, range(1, 9)))
    if min(rates) <= 0.0 or max(rates) > 10_000.0 or len(set(rates)) != len(rates):
        raise ParameterError(f"sync.rates is {given!r}; valid: different rates above 0 to 10000 [Hz]")
    return SyncSpec(rates, section.number("delay", DELAY, 0.0, 10.0))


def _channels(section: Section) -> tuple[str, ...]:
    given = section.content.get("channels", len(MUSCLES))
    if isinstance(given, int) and not isinstance(given, bool) and 1 <= given <= len(MUSCLES):
        return MUSCLES[:given]
    good = isinstance(given, list | tuple) and given and all(isinstance(name, str) and name for name in given)
    if not good or len(set(given)) != len(given) or len(given) > MOST_CHANNELS:
        raise ParameterError(f"emg.channels is {given!r}; valid: 1 to {len(MUSCLES)} of the usual muscles, or a list of different names")
    return tuple(given)


def _sensor(
    section: Section, channels: tuple[str, ...], transports: tuple[str, ...], rate: float, lowest: float, driver: tuple[str, ...]
) -> SensorSpec:
    """What both kinds share."""
    section.section("lsl").only(*LSL_KEYS)
    faults = section.section("emulated").section("faults")
    read_faults(faults, 0)
    return SensorSpec(
        device=section.text("device", EMULATED, DEVICES),
        transport=section.text("transport", transports[0], transports),
        channels=channels,
        rate=section.number("rate", rate, lowest, 20_000.0),
        chunk=section.number("chunk", CHUNK, 0.001, 1.0),
        driver={key: section.content[key] for key in driver if section.content.get(key) is not None},
        emulated=section.section("emulated").content,
    )


READERS: dict[str, Callable[[Any], Any]] = {"mocap": read_mocap, "emg": read_emg, "force_plate": read_plate, "sync": read_sync}
"""Of each section."""
