"""Parameters of the nodes of an experiment's sensors: drivers, emulated devices, and the synchroniser that brings all of them together."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlparse

from hric_experiments.experiment import Experiment
from hric_experiments.sensor_spec import EMULATED, SensorSpec
from hric_perception.plate.geometry import CHANNELS
from hric_perception.sync.topics import TOPIC, rate_topic
from mocap_natnet.trial import located

EMG, EMULATED_EMG, PLATE, EMULATED_PLATE, SYNC = "emg", "emulated_emg", "force_plate", "emulated_plate", "synchronizer"
EMG_TOPIC, FRAMES, LOG = "/hric/perception/emg/raw", "/hric/perception/mocap", "control_log"
NATNET_PORTS = {"command_port": 1512, "data_port": 1513}
"""Of an emulated plate's Motive, beside the one of the motion capture (our choice)."""
BLOCK = 0.02
"""An emulated device sends so often at least [s of wall time], which is what real ones do (our choice)."""
MOCAP_GAP, CHUNK_GAP = 0.05, 0.01
"""Furthest that samples may be apart to be interpolated [s]: an occlusion is not bridged, nor is what is lost (our choice)."""


def nodes(experiment: Experiment, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Private parameters of the sensors' nodes, by their names; empty without one of the sections `emg`, `force_plate`, `sync`."""
    found: dict[str, dict[str, Any]] = {}
    emg, plate = experiment.emg, experiment.force_plate
    if emg is not None and emg.used:
        found[EMG] = _driver(emg, "emg")
        if emg.transport == "trigno":
            names = [*emg.channels, *["time"] * emg.time_code]
            found[EMG]["trigno"] = {**found[EMG].get("trigno", {}), "channels": names}
        if emg.device == EMULATED:
            found[EMULATED_EMG] = _emulated(emg, EMULATED_EMG, seed) | {"muscles": list(emg.channels)} | _trigno_ports(emg)
    if plate is not None and plate.used:
        found[PLATE] = _driver(plate, "force_plate")
        if plate.device == EMULATED:
            pose = {key: value for key, value in (plate.driver.get("pose") or {}).items() if key != "frame"}
            found[EMULATED_PLATE] = _emulated(plate, EMULATED_PLATE, seed) | ({"pose": pose} if pose else {})
            if plate.transport == "natnet":
                found[EMULATED_PLATE]["natnet"] = NATNET_PORTS | dict(plate.emulated.get("natnet") or {})
                found[PLATE]["natnet"] = {"server": "127.0.0.1", **NATNET_PORTS, **(plate.driver.get("natnet") or {})}
    if experiment.sync is not None:
        found[SYNC] = {"plan": plan(experiment), "rates": list(experiment.sync.rates)}
    return found


def sync_topics(experiment: Experiment) -> list[str]:
    """Topics of the synchronised samples, in the order of the rates."""
    return [] if experiment.sync is None else [rate_topic(TOPIC, rate) for rate in experiment.sync.rates]


def plate_topic(spec: SensorSpec) -> str:
    """Where the samples of a plate are."""
    return f"/hric/perception/force_plate/{spec.driver.get('id', '1')}/samples"


def plan(experiment: Experiment) -> dict[str, Any]:
    """What is synchronised: each source that the experiment has. A time code goes with its source, so that the samples tell their own skew."""
    assert experiment.sync is not None
    joints = ", ".join(_joints(experiment))
    sources: list[dict[str, Any]] = [
        {"topic": LOG, "type": "hric_msgs/ControlLog", "signals": [f"{name}[{joints}]" for name in ("position", "velocity", "effort")]}
    ]
    if experiment.mocap is not None:
        pose = f"rigid_bodies[{experiment.mocap.body}].pose"
        sources.append({"topic": FRAMES, "type": "hric_msgs/MocapData", "max_gap": MOCAP_GAP, "signals": [pose]})
    emg, plate = experiment.emg, experiment.force_plate
    if emg is not None and emg.used:
        sources.append(_chunks(EMG_TOPIC, emg, [{"field": f"data[{', '.join(emg.channels)}]", "unit": "V"}]))
    if plate is not None and plate.used:
        forces, moments = ", ".join(CHANNELS[:3]), ", ".join(CHANNELS[3:])
        sources.append(_chunks(plate_topic(plate), plate, [{"field": f"data[{forces}]", "unit": "N"}, {"field": f"data[{moments}]", "unit": "N m"}]))
    return {"policy": "resample", "rate": experiment.sync.rates[0], "delay": experiment.sync.delay, "sources": sources}


def _chunks(topic: str, spec: SensorSpec, signals: list[dict[str, str]]) -> dict[str, Any]:
    code = [{"field": "data[time]", "unit": "s"}] if spec.time_code and spec.transport == "lsl" else []
    return {"topic": topic, "type": "hric_msgs/SampleChunk", "max_gap": CHUNK_GAP, "signals": signals + code}


def _joints(experiment: Experiment) -> list[str]:
    """As a controller names them, else those of a Panda."""
    from hric_experiments import parameters

    for values in parameters.controllers(experiment).values():
        if isinstance(values.get("joints"), list) and values["joints"]:
            return [str(joint) for joint in values["joints"]]
    return [f"{experiment.robot.arm_id}_joint{number}" for number in range(1, 8)]


def _driver(spec: SensorSpec, kind: str) -> dict[str, Any]:
    values = {"source": spec.transport, "chunk": spec.chunk, **spec.driver}
    if spec.transport == "lsl":
        lsl = dict(spec.driver.get("lsl") or {})
        if spec.device == EMULATED:
            lsl = {"name": f"emulated_{kind.removeprefix('force_')}", "session": session()} | lsl
        values["lsl"] = lsl
    if not values.get("lsl"):
        values.pop("lsl", None)
    return values


def _emulated(spec: SensorSpec, name: str, seed: int) -> dict[str, Any]:
    values: dict[str, Any] = {"transport": spec.transport, "rate": spec.rate, "seed": seed, "block": min(spec.chunk / 2, BLOCK)}
    values |= located(spec.emulated, Path.cwd())
    if spec.transport == "lsl":
        given: Mapping[str, Any] = spec.driver.get("lsl") or {}
        values |= {"name": given.get("name", name), "session": given.get("session", session())}
    return values


def _trigno_ports(spec: SensorSpec) -> dict[str, Any]:
    given = spec.driver.get("trigno") or {}
    ports = {key: given[key] for key in ("command_port", "data_port") if key in given}
    return ports | ({"ip": given["host"]} if "host" in given else {}) if spec.transport == "trigno" else {}


def session() -> str:
    """LSL session of emulated devices: bring-ups beside each other on one machine have masters with different ports."""
    port = urlparse(os.environ.get("ROS_MASTER_URI", "")).port
    return f"hric_{port or 11311}"
